// SPDX-License-Identifier: MIT

/// @file
/// Any shared points, matrices and yaws into transforms, any transforms into a site of subnets, and
/// any fixes of theirs into one in the map, learning as it goes. A rotation turns and does no more,
/// covariances are some, a fix is finite and says truly what it was made of; everything else is a
/// named error.

#include <array>
#include <cmath>
#include <span>

#include "uwbpos/frames/fit_transform.hpp"
#include "uwbpos/frames/fuse_fixes.hpp"
#include "uwbpos/frames/make_transform.hpp"

#include "bytes.hpp"
#include "checks.hpp"
#include "heap.hpp"

namespace {

using namespace uwbpos;
using namespace uwbpos::fuzz;

// Few, so that the limit is met too.
constexpr int kSubnets = 3;

template <class S, int D>
void check_transform(const Transform<S, D>& t) {
  const S rounding = S(64) * std::numeric_limits<S>::epsilon();
  const Mat<S, D> gram = t.rotation.transpose() * t.rotation;
  for (int i = 0; i < D; ++i) {
    require(std::isfinite(t.translation[i]), "finite translation");
    for (int j = 0; j < D; ++j) {
      require(std::abs(gram(i, j) - S(i == j)) <= rounding, "a rotation's axes are orthonormal");
    }
  }
  require(signed_volume<S, D>(t.rotation) > 0, "a rotation does not mirror");
  check_covariance<S, kTransformDof<D>>(t.covariance);
}

// What `t` takes there, its inverse takes back; composed with it, nothing moves.
template <class S, int D>
void check_inverse(const Transform<S, D>& t, const Vec<S, D>& point) {
  const Transform<S, D> back = inverse(t);
  const S size = std::sqrt(point.squaredNorm()) + std::sqrt(t.translation.squaredNorm());
  if (!std::isfinite(size)) return;
  const S rounding = S(64) * std::numeric_limits<S>::epsilon() * (S(1) + size);
  const Vec<S, D> again = apply(back, apply(t, point));
  const Transform<S, D> none = compose(back, t);
  for (int k = 0; k < D; ++k) {
    require(std::abs(again[k] - point[k]) <= rounding, "there and back again");
    require(std::abs(none.translation[k]) <= rounding, "a motion and its inverse cancel");
  }
}

template <class S, int N>
Mat<S, N> take_covariance(Bytes& bytes) {
  Mat<S, N> covariance = Mat<S, N>::Zero();
  const auto kind = bytes.take<std::uint8_t>();
  for (int i = 0; i < N; ++i) {
    covariance(i, i) = kind < 128 ? S(1e-4) * S(1 + (kind >> i & 3)) : bytes.number(S(1e-4));
  }
  if (kind % 4 == 3) covariance(0, N - 1) = covariance(N - 1, 0) = bytes.number(S(1e-5));
  return covariance;
}

template <class S, int D>
Result<Transform<S, D>> take_transform(Bytes& bytes) {
  const auto kind = bytes.take<std::uint8_t>();
  Vec<S, D> translation;
  for (S& coordinate : translation) coordinate = bytes.number(S(0.01));
  const auto covariance = take_covariance<S, kTransformDof<D>>(bytes);
  if (kind < 160) {
    return transform_from_yaw<S, D>(bytes.number(S(1e-3)), translation, covariance);
  }
  // A rotation about some axis, with a number or two that were typed wrong.
  Mat<S, D> matrix = Mat<S, D>::Identity();
  const S yaw = bytes.number(S(1e-3));
  if (std::isfinite(yaw)) {
    matrix(0, 0) = matrix(D - 1, D - 1) = cosine(yaw);
    matrix(0, D - 1) = -sine(yaw);
    matrix(D - 1, 0) = sine(yaw);
  }
  if (kind % 2 == 1) matrix(kind / 2 % D, kind / 8 % D) += bytes.number(S(1e-5));
  return transform_from_rotation<S, D>(matrix, translation, covariance);
}

template <class S, int D>
void run_fit(Bytes bytes) {
  const auto flags = bytes.take<std::uint8_t>();
  FitTransformOptions<S> options;
  if ((flags & 1) != 0) options.max_turn_sigma = bytes.number(S(0.001));
  Transform<S, D> truth;
  if ((flags & 2) != 0) {
    if (const auto made = take_transform<S, D>(bytes)) truth = *made;
  }
  // More than a fit takes, so that the limit is met too.
  std::array<SharedPoint<S, D>, kMaxMeasurements + 1> points;
  std::size_t count = 0;
  while (count < points.size() && !bytes.empty()) {
    SharedPoint<S, D>& p = points[count++];
    for (S& coordinate : p.in_b) coordinate = bytes.number(S(0.01));
    p.in_a = apply(truth, p.in_b);
    const auto kind = bytes.take<std::uint8_t>();
    for (S& coordinate : p.in_a) coordinate += S(0.001) * S(bytes.take<std::int8_t>());
    if (kind % 8 == 0) p.in_a[kind / 8 % D] = bytes.number(S(0.01));
    p.sigma = kind < 200 ? S(0.05) : bytes.number(S(0.001));
  }
  const std::span shared{points.data(), count};
  const auto fit = [&] {
    const NoHeap guard;
    return fit_transform(shared, options);
  }();
  if (!fit) {
    require(!describe(fit.error()).empty(), "every error has a description");
    return;
  }
  check_transform(fit->a_T_b);
  require(fit->degrees_of_freedom == static_cast<int>(count) * D - kTransformDof<D>, "freedom");
  require(fit->worst_point >= 0 && fit->worst_point < static_cast<int>(count), "a point");
  require(fit->chi_squared >= 0 && fit->rms >= 0, "sums of squares");
  require(fit->rms <= fit->worst * (S(1) + S(1e-5)) && std::isfinite(fit->worst),
          "the worst is no better than the mean");
  check_inverse<S, D>(fit->a_T_b, points[0].in_b);
}

template <class S, int D>
void check_site(const Subnets<S, D, kSubnets>& site) {
  for (int i = 0; i < site.size(); ++i) {
    check_transform(site[i].map_T_subnet);
    require(site.place(site[i].id) == i, "a subnet is where it says");
  }
  check_covariance<S, kSubnets * kTransformDof<D>>(site.errors().covariance);
}

template <class S, int D>
SubnetFix<S, D> take_fix(const Subnets<S, D, kSubnets>& site, const Vec<S, D>& tag, Bytes& bytes) {
  const auto kind = bytes.take<std::uint8_t>();
  SubnetFix<S, D> heard{kind % 4U, {}};
  heard.fix.position = tag;
  if (const auto subnet = site.find(heard.subnet)) {
    heard.fix.position = apply(inverse(subnet->map_T_subnet), tag);
  }
  for (S& coordinate : heard.fix.position) {
    coordinate += kind < 200 ? S(0.01) * S(bytes.take<std::int8_t>()) : bytes.number(S(0.01));
  }
  heard.fix.covariance = take_covariance<S, D>(bytes);
  heard.fix.chi_squared = kind % 16 == 0 ? bytes.number(S(0.1)) : S(1);
  heard.fix.degrees_of_freedom = 1;
  return heard;
}

template <class S, int D>
void run_site(Bytes bytes) {
  const auto flags = bytes.take<std::uint8_t>();
  Subnets<S, D, kSubnets> site;
  FuseOptions<S> options;
  if ((flags & 1) != 0) options.gate = bytes.number(S(0.01));
  if ((flags & 2) != 0) options.preferred = bytes.take<std::uint8_t>() % 4U;
  if ((flags & 4) != 0) options.preference = bytes.number(S(0.1));
  if ((flags & 8) != 0) options.correlated_fixes = bytes.number(S(0.1));
  const int wanted = 1 + (flags >> 4) % 5;
  for (int i = 0; i < wanted; ++i) {
    if (const auto t = take_transform<S, D>(bytes)) {
      check_transform(*t);
      const int before = site.size();
      const auto added = site.add({bytes.take<std::uint8_t>() % 4U, 7, *t});
      require(site.size() == before + (added ? 1 : 0), "one more, or none");
    }
  }
  check_site(site);
  while (!bytes.empty()) {
    const auto step = bytes.take<std::uint8_t>();
    Vec<S, D> tag;
    for (S& coordinate : tag) coordinate = bytes.number(S(0.01));
    std::array<SubnetFix<S, D>, kMaxHeard + 1> fixes;
    const std::size_t count = step % (kMaxHeard + 2U);
    for (std::size_t i = 0; i < count; ++i) fixes[i] = take_fix<S, D>(site, tag, bytes);
    const std::span heard{fixes.data(), count};
    const auto fused = [&] {
      const NoHeap guard;
      return step < 200 ? fuse_and_learn(site, heard, options) : fuse_fixes(site, heard, options);
    }();
    if (!fused) {
      require(!describe(fused.error()).empty(), "every error has a description");
      continue;
    }
    for (const S coordinate : fused->fix.position) require(std::isfinite(coordinate), "position");
    check_covariance<S, D>(fused->fix.covariance);
    require(fused->disagreement >= 0, "a disagreement is not negative");
    require(fused->heard == static_cast<int>(count), "those given were heard");
    require(fused->disagreement_dof == D * (fused->heard - 1), "what they could disagree in");
    int used = 0;
    bool leads = false;
    for (std::size_t i = 0; i < count; ++i) {
      if (!fused->used[i]) continue;
      ++used;
      leads = leads || fixes[i].subnet == fused->leading;
    }
    require(used == fused->fused && used > 0, "those used are counted");
    require(leads, "the one that leads was used");
    require(fused->fix.degrees_of_freedom == D * (used - 1) + used, "degrees of freedom");
    check_site(site);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  with_scalar_and_dimension(Bytes{std::span{data, size}}, []<class S, int D>(Bytes bytes) {
    if (bytes.take<std::uint8_t>() % 4 == 0) {
      run_fit<S, D>(bytes);
    } else {
      run_site<S, D>(bytes);
    }
  });
  return 0;
}
