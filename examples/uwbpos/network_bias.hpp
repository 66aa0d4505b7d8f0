// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Readings less the biases that a network predicts, where the body's attitude is known from
/// elsewhere, as from an inertial unit: one tag is enough then, and differences go as well.

#include <functional>
#include <vector>

#include "formats.hpp"
#include "replay.hpp"
#include "settings.hpp"

namespace uwbpos::host {

/// Solves, takes off what `site.network` says at the positions found and the attitudes of
/// `site.attitude`, and solves again until no bias changes by a millimetre, ten times at most.
/// `result.without_bias` counts readings without a position of their tag within a second, without
/// an attitude, or whose link the network does not know. Throws `Failure` where heights are left
/// out.
[[nodiscard]] Replay replay_with_network(
    const Settings& settings, Site site, const std::vector<Reading>& readings,
    const std::function<void(std::size_t, std::size_t)>& progress = {});

/// The same of differences: of each the bias of the link to b less that to a.
[[nodiscard]] Replay replay_with_network(
    const Settings& settings, Site site, const std::vector<Difference>& differences,
    const std::function<void(std::size_t, std::size_t)>& progress = {});

}  // namespace uwbpos::host
