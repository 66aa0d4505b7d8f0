// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <numbers>

#include <doctest/doctest.h>

#include "uwbpos/core/angle.hpp"
#include "uwbpos/core/quaternion.hpp"
#include "uwbpos/filter/motion/constant_velocity.hpp"
#include "uwbpos/filter/motion/inertial.hpp"
#include "uwbpos/filter/motion/planar_body.hpp"
#include "uwbpos/filter/motion/planar_robot.hpp"
#include "uwbpos/sim/noise.hpp"

#include "support/numeric_jacobian.hpp"
#include "support/random_geometry.hpp"

namespace tests::filter_motion {

namespace {

using namespace uwbpos;

static_assert(MotionModel<ConstantVelocity<float, 2>> && MotionModel<ConstantVelocity<double, 3>>);
static_assert(MotionModel<PlanarRobot<float>> && MotionModel<PlanarBody<double>>);
static_assert(MotionModel<Inertial<float>>);

template <class M>
using VecOf = Vec<typename M::Scalar, M::kDof>;

// The error that takes `from` to `to`: what `correct` undoes.
template <class S, int N>
Vec<S, N> error_between(const Vec<S, N>& to, const Vec<S, N>& from, int angle) {
  Vec<S, N> e = to - from;
  if (angle >= 0) e[angle] = wrap_angle(e[angle]);
  return e;
}

template <class S>
Vec<S, 15> error_between(const InertialState<S>& to, const InertialState<S>& from, int) {
  Vec<S, 15> e;
  const Quaternion<S> turn = multiply<S>(to.orientation, conjugate(from.orientation));
  e.template segment<3>(0) = to.position - from.position;
  e.template segment<3>(3) = S(2) * turn.template tail<3>() * (turn[0] < 0 ? S(-1) : S(1));
  e.template segment<3>(6) = to.velocity - from.velocity;
  e.template segment<3>(9) = to.gyro_bias - from.gyro_bias;
  e.template segment<3>(12) = to.accelerometer_bias - from.accelerometer_bias;
  return e;
}

template <class M>
constexpr int angle_of() {
  if constexpr (M::kHasHeading) return M::kHeading;
  return -1;
}

// F, rows of places, velocities and headings against central differences about `state`.
template <class M>
void check_jacobians(const M& motion, const typename M::State& state,
                     const typename M::Input& input, typename M::Scalar t,
                     typename M::Scalar second_order) {
  using S = typename M::Scalar;
  const S tolerance = S(30) * std::pow(std::numeric_limits<S>::epsilon(), S(2) / 3);
  const auto moved = [&](const VecOf<M>& error) {
    typename M::State s = state;
    motion.correct(s, error);
    return s;
  };
  typename M::State mean = state;
  const auto step = motion.propagate(mean, input, t);
  const auto after = [&](const VecOf<M>& error) -> VecOf<M> {
    typename M::State s = moved(error);
    static_cast<void>(motion.propagate(s, input, t));
    return error_between(s, mean, angle_of<M>());
  };
  const VecOf<M> zero = VecOf<M>::Zero();
  const auto f = test::numeric_jacobian<M::kDof, S, M::kDof>(after, zero);
  CHECK((f - step.f).cwiseAbs().maxCoeff() < tolerance + second_order);

  const Vec<S, 3> lever =
      M::kHasHeading ? Vec<S, 3>{S(0.3), S(-0.2), S(0.1)} : Vec<S, 3>{Vec<S, 3>::Zero()};
  const Vec<S, 3> g{S(0.6), S(-0.7), S(0.4)};
  const auto along = [&](const VecOf<M>& e) { return g.dot(motion.place(moved(e), lever)); };
  const VecOf<M> row = test::numeric_gradient<S, M::kDof>(along, zero);
  CHECK((row.template head<M::kPoseDof>() - motion.place_row(state, lever, g)).norm() < tolerance);
  CHECK(row.template tail<M::kDof - M::kPoseDof>().norm() < tolerance);
  for (int axis = 0; axis < M::kDimension; ++axis) {
    const auto v = [&](const VecOf<M>& e) { return motion.velocity(moved(e))[axis]; };
    const VecOf<M> wanted = test::numeric_gradient<S, M::kDof>(v, zero);
    const auto got = motion.velocity_row(state, axis);
    CHECK((wanted.template head<M::kVelocityDof>() - got).norm() < tolerance);
  }
  if constexpr (M::kHasHeading) {
    const auto h = [&](const VecOf<M>& e) {
      return angle_difference(motion.heading(moved(e)), motion.heading(state));
    };
    const VecOf<M> wanted = test::numeric_gradient<S, M::kDof>(h, zero);
    CHECK((wanted.template head<M::kPoseDof>() - motion.heading_row(state)).norm() < tolerance);
  }
}

template <class S>
InertialState<S> tumbling(sim::Random& random) {
  InertialState<S> state;
  state.position = test::random_in_cube<S, 3>(random, S(3));
  state.orientation = quaternion_from_turn<S>(test::random_in_cube<S, 3>(random, S(0.5)));
  state.velocity = test::random_in_cube<S, 3>(random, S(1));
  state.gyro_bias = test::random_in_cube<S, 3>(random, S(0.02));
  state.accelerometer_bias = test::random_in_cube<S, 3>(random, S(0.2));
  return state;
}

TEST_CASE_TEMPLATE("motion: Jacobians are those of central differences", S, float, double) {
  sim::Random random{"jacobians"};
  for (int trial = 0; trial < 20; ++trial) {
    check_jacobians(ConstantVelocity<S, 2>{}, test::random_in_cube<S, 4>(random, S(2)), {}, S(0.3),
                    S(0));
    check_jacobians(ConstantVelocity<S, 3>{}, test::random_in_cube<S, 6>(random, S(2)), {}, S(0.3),
                    S(0));
    // Straight on, nearly so, and around; across the branch cut of the heading.
    for (const double rate : {0.0, 1e-4, 0.8, -2.0}) {
      Vec<S, 5> robot = test::random_in_cube<S, 5>(random, S(2));
      robot[2] = static_cast<S>(random.uniform(-3.1, 3.1));
      robot[4] = static_cast<S>(rate);
      check_jacobians(PlanarRobot<S>{}, robot, {}, S(0.1), S(0));
      Vec<S, 6> body = test::random_in_cube<S, 6>(random, S(2));
      body[5] = static_cast<S>(rate);
      check_jacobians(PlanarBody<S>{}, body, {}, S(0.1), S(0));
    }
    InertialInput<S> input{test::random_in_cube<S, 3>(random, S(1)), {S(1), S(-0.5), S(9.6)}, S(0)};
    // What (2) leaves out is of third order in the step: (|ω| t)² t |a| ≈ 1e-6 at 5 ms.
    check_jacobians(Inertial<S>{}, tumbling<S>(random), input, S(0.005), S(2e-4));
    input.age = S(1);
    check_jacobians(Inertial<S>{}, tumbling<S>(random), input, S(0.005), S(0));
  }
}

// Two steps are one step of their sum: F₂F₁ = F, F₂Q₁F₂ᵀ + Q₂ = Q.
template <class M>
void check_semigroup(const M& motion, typename M::State state, typename M::Scalar t,
                     double of_variance) {
  using S = typename M::Scalar;
  typename M::State once = state;
  const auto q_of = [](const auto& p) {
    return Mat<S, M::kDof>{p.g * p.q.asDiagonal() * p.g.transpose()};
  };
  const auto whole = motion.propagate(once, {}, S(2) * t);
  const auto first = motion.propagate(state, {}, t);
  const auto second = motion.propagate(state, {}, t);
  CHECK((state - once).norm() < S(1e-5));
  CHECK((second.f * first.f - whole.f).cwiseAbs().maxCoeff() < S(1e-5));
  const Mat<S, M::kDof> q = second.f * q_of(first) * second.f.transpose() + q_of(second);
  const Mat<S, M::kDof> wanted = q_of(whole);
  for (int i = 0; i < M::kDof; ++i) {
    CHECK(static_cast<double>(q(i, i)) ==
          doctest::Approx(static_cast<double>(wanted(i, i))).epsilon(of_variance));
  }
}

TEST_CASE_TEMPLATE("motion: two steps are one of twice the length", S, float, double) {
  check_semigroup(ConstantVelocity<S, 2>{}, Vec<S, 4>{S(1), S(2), S(0.5), S(-1)}, S(0.4), 1e-5);
  check_semigroup(ConstantVelocity<S, 3>{}, Vec<S, 6>{Vec<S, 6>::Constant(S(0.7))}, S(0.4), 1e-5);
  // On a curve the noise of a step is taken as straight: second order in ωt = 0.05.
  check_semigroup(PlanarRobot<S>{}, Vec<S, 5>{S(1), S(2), S(3), S(1), S(0.5)}, S(0.1), 0.02);
  check_semigroup(PlanarBody<S>{}, Vec<S, 6>{S(1), S(2), S(3), S(1), S(0.2), S(0.5)}, S(0.1), 0.02);
}

TEST_CASE_TEMPLATE("motion: a robot that drives a circle comes back", S, float, double) {
  PlanarRobot<S> motion;
  PlanarBody<S> body;
  const S turn = S(2) * std::numbers::pi_v<S>;
  Vec<S, 5> robot{S(1), S(2), S(0.5), S(1), turn / S(10)};
  Vec<S, 6> crab{S(1), S(2), S(0.5), S(0.8), S(-0.6), turn / S(10)};
  for (int i = 0; i < 100; ++i) {
    static_cast<void>(motion.propagate(robot, {}, S(0.1)));
    static_cast<void>(body.propagate(crab, {}, S(0.1)));
  }
  CHECK((robot.template head<3>() - Vec<S, 3>{S(1), S(2), S(0.5)}).norm() < S(2e-5));
  CHECK((crab.template head<3>() - Vec<S, 3>{S(1), S(2), S(0.5)}).norm() < S(2e-5));
}

TEST_CASE_TEMPLATE("motion: an inertial body turns, falls and coasts", S, float, double) {
  const Inertial<S> motion;
  InertialState<S> state;
  // On a turntable at rest: half a turn in a second.
  InertialInput<S> input{{S(0), S(0), std::numbers::pi_v<S>}, {S(0), S(0), motion.gravity}, S(0)};
  for (int i = 0; i < 200; ++i) static_cast<void>(motion.propagate(state, input, S(0.005)));
  CHECK(state.position.norm() < S(1e-4));
  CHECK(std::abs(std::abs(motion.heading(state)) - std::numbers::pi_v<S>) < S(1e-4));
  // Falling: no force is felt.
  state = {};
  input = {Vec<S, 3>::Zero(), Vec<S, 3>::Zero(), S(0)};
  for (int i = 0; i < 100; ++i) static_cast<void>(motion.propagate(state, input, S(0.01)));
  CHECK(std::abs(state.position[2] + motion.gravity / 2) < S(1e-3));
  // Without samples it goes straight on and knows less and less.
  state.velocity = {S(1), S(0), S(0)};
  state.position.setZero();
  input.age = S(5);
  const auto blind = motion.propagate(state, input, S(0.5));
  CHECK(state.position[0] == doctest::Approx(0.5));
  const S pushed = motion.blind_acceleration;
  CHECK(std::abs(blind.q[0] - pushed * pushed / 2) < S(1e-5));
}

TEST_CASE_TEMPLATE("motion: an inertial body begins upright and looks where told", S, float,
                   double) {
  sim::Random random{"upright"};
  const Inertial<S> motion;
  for (int trial = 0; trial < 50; ++trial) {
    const Quaternion<S> tilted =
        quaternion_from_turn<S>(test::random_in_cube<S, 3>(random, S(0.6)));
    Beginning<S> from{.position = {S(1), S(2), S(3)}};
    from.heading = static_cast<S>(random.uniform(-3, 3));
    // What the accelerometer of a body so tilted reads at rest: gravity's reaction in its axes.
    from.specific_force = rotate<S>(conjugate(tilted), {S(0), S(0), motion.gravity});
    Vec<S, 15> variances = Vec<S, 15>::Zero();
    const InertialState<S> state = motion.begin(from, variances);
    CHECK(std::abs(angle_difference(motion.heading(state), from.heading)) < S(1e-5));
    const Vec<S, 3> up = rotate<S>(state.orientation, from.specific_force);
    CHECK((up - Vec<S, 3>{S(0), S(0), motion.gravity}).norm() < S(1e-4));
    CHECK(variances.template tail<12>().minCoeff() > 0);
  }
}

}  // namespace

TEST_CASE_TEMPLATE("motion: every noise and height has a domain", S, float, double) {
  const auto holds = [](auto motion, auto... members) {
    CHECK(motion.is_valid());
    const auto without = [&](auto member) {
      for (const S bad : {std::numeric_limits<S>::quiet_NaN(), S(-2e6), S(2e6),
                          std::numeric_limits<S>::infinity()}) {
        auto other = motion;
        other.*member = bad;
        CHECK(!other.is_valid());
      }
    };
    (without(members), ...);
  };
  using V = ConstantVelocity<S, 3>;
  holds(V{}, &V::acceleration, &V::height);
  using R = PlanarRobot<S>;
  holds(R{}, &R::acceleration, &R::turn_acceleration, &R::slip, &R::height, &R::gyro_sigma);
  using B = PlanarBody<S>;
  holds(B{}, &B::acceleration, &B::sideward_acceleration, &B::turn_acceleration, &B::height,
        &B::gyro_sigma);
  using I = Inertial<S>;
  holds(I{}, &I::accelerometer_noise, &I::gyro_noise, &I::accelerometer_wander, &I::gyro_wander,
        &I::accelerometer_bias_sigma, &I::gyro_bias_sigma, &I::tilt_sigma, &I::gravity,
        &I::max_silence, &I::blind_acceleration, &I::blind_turn);
}

}  // namespace tests::filter_motion
