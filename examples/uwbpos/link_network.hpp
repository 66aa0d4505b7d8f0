// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// A trained network of the links' biases, as examples/bias_training/train.py writes it.

#include <filesystem>
#include <map>
#include <optional>

#include "uwbpos/filter/bias_network.hpp"
#include "uwbpos/filter/link_features.hpp"

#include "formats.hpp"

namespace uwbpos::host {

/// The library's network, large enough for any that a file holds: what is not used is zero, which
/// it passes over.
class LinkNetwork {
 public:
  static constexpr std::size_t kAnchors = 64;
  static constexpr std::size_t kTags = 8;
  static constexpr std::size_t kNeurons = 64;  ///< in a hidden layer

  /// Reads bias_network.json. Throws `Failure` if it is none, is too large, or does not give the
  /// biases to 1e-5 m that its trainer wrote down with it.
  explicit LinkNetwork(const std::filesystem::path& file);

  /// The bias of a range, estimate minus truth [m]. `offset`: anchor minus tag antenna [m];
  /// `map_R_body`: the body's attitude. Nothing for a link whose anchor or tag training did not
  /// have, or for numbers that are not finite.
  [[nodiscard]] std::optional<double> bias(Id tag, Id anchor, const Vec3& offset,
                                           const Mat<double, 3>& map_R_body) const;

 private:
  using Network = BiasNetwork<double, kLinkGeometry + kAnchors + kTags, kNeurons, kNeurons>;

  std::map<Id, std::size_t> anchors_;
  std::map<Id, std::size_t> tags_;
  Network network_{};
};

}  // namespace uwbpos::host
