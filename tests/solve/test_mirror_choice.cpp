// SPDX-License-Identifier: MIT
#include <doctest/doctest.h>

#include "uwbpos/solve/mirror_choice.hpp"

namespace tests::solve_mirror_choice {

using namespace uwbpos;

TEST_CASE_TEMPLATE("odds decide when the better image is believable", S, float, double) {
  CHECK(rules_out(S(1), S(12), 1, S(9), S(0)));
  CHECK_FALSE(rules_out(S(1), S(9), 1, S(9), S(0)));
  // Neither is believable: an outlier may have drawn the better one.
  CHECK_FALSE(rules_out(S(200), S(230), 1, S(9), S(0)));
  CHECK(rules_out(S(200), S(500), 1, S(9), S(0)));
}

TEST_CASE_TEMPLATE("a fit a hundred times closer decides whatever sigma says", S, float, double) {
  CHECK(rules_out(S(1e-9), S(1e-2), 1, S(9), S(1e-8)));
  CHECK_FALSE(rules_out(S(1e-5), S(1e-2), 1, S(9), S(0)));
  CHECK_FALSE(rules_out(S(0), S(1e-5), 1, S(9), S(1e-8)));  // within what rounding may do
}

TEST_CASE_TEMPLATE("the side decides before the prior, the prior when the side is silent", S, float,
                   double) {
  const Vec<S, 2> up{0, 1};
  const Vec<S, 2> down{0, -1};
  using Options = LocateOptions<S, 2>;
  CHECK(choose_by_knowledge(up, down, Options{}) == MirrorChoice::Unknown);
  CHECK(choose_by_knowledge(up, down, Options{{0, 5}}) == MirrorChoice::First);
  CHECK(choose_by_knowledge(up, down, Options{{0, -5}, up}) == MirrorChoice::Second);
  CHECK(choose_by_knowledge(up, down, Options{{1, 0}, down}) == MirrorChoice::Second);
  CHECK(choose_by_knowledge(up, down, Options{{0, 0}, up}) == MirrorChoice::First);
  CHECK(choose_by_knowledge(up, down, Options{{0, 0}, Vec<S, 2>{7, 0}}) == MirrorChoice::Unknown);
}

}  // namespace tests::solve_mirror_choice
