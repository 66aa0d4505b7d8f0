// SPDX-License-Identifier: MIT
#include "link_network.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "failure.hpp"

namespace uwbpos::host {
namespace {

using Numbers = std::vector<double>;

void expect(bool truth, const char* what) {
  if (!truth) throw std::runtime_error{what};
}

std::map<Id, std::size_t> places_of(const nlohmann::json& ids, std::size_t most, const char* what) {
  std::map<Id, std::size_t> places;
  for (const auto& id : ids) {
    // Its own conversion takes any number, as C++ does.
    expect(id.is_number_unsigned() && id.get<std::uint64_t>() <= std::numeric_limits<Id>::max(),
           "an id is not a whole number of 32 bits");
    places.emplace(id.get<Id>(), places.size());
  }
  expect(places.size() == ids.size() && places.size() <= most, what);
  return places;
}

// Weights and biases of one layer; `place(i)`: where its input i goes.
template <std::size_t In, std::size_t Out, class Place>
std::size_t fill(DenseLayer<double, In, Out>& layer, const nlohmann::json& from, std::size_t inputs,
                 const Place& place) {
  const auto weights = from.at("weights").get<std::vector<Numbers>>();
  const auto biases = from.at("biases").get<Numbers>();
  expect(weights.size() == inputs, "a layer has another number of inputs than the one before has");
  expect(biases.size() <= Out && !biases.empty(), "a layer is too large, or empty");
  for (std::size_t i = 0; i < inputs; ++i) {
    expect(weights[i].size() == biases.size(), "a row of weights is too long or too short");
    std::ranges::copy(weights[i], layer.weights[place(i)].begin());
  }
  std::ranges::copy(biases, layer.biases.begin());
  return biases.size();
}

}  // namespace

LinkNetwork::LinkNetwork(const std::filesystem::path& file) try {
  std::ifstream stream{file};
  if (!stream) throw Failure{fmt::format("{}: cannot be read", file.string())};
  const auto json = nlohmann::json::parse(stream);
  anchors_ = places_of(json.at("anchors"), kAnchors, "expected up to 64 different anchors");
  tags_ = places_of(json.at("tags"), kTags, "expected up to 8 different tags");
  const std::size_t inputs = kLinkGeometry + anchors_.size() + tags_.size();
  const auto place = [&](std::size_t i) {
    return i < kLinkGeometry + anchors_.size() ? i : i + kAnchors - anchors_.size();
  };
  const auto take = [&](const char* key, auto& to) {
    const auto numbers = json.at(key).get<Numbers>();
    expect(numbers.size() == inputs, "expected ten inputs and one for each anchor and tag");
    for (std::size_t i = 0; i < inputs; ++i) to[place(i)] = numbers[i];
  };
  take("lowest", network_.lowest);
  take("highest", network_.highest);
  take("mean", network_.mean);
  take("inverse_deviation", network_.inverse_deviation);
  for (std::size_t i = 0; i < network_.lowest.size(); ++i) {
    expect(network_.lowest[i] <= network_.highest[i], "a lowest input exceeds the highest");
  }
  const auto& layers = json.at("layers");
  expect(layers.size() == 3, "expected three layers");
  const auto same = [](std::size_t i) { return i; };
  const std::size_t first = fill(network_.first, layers[0], inputs, place);
  const std::size_t second = fill(network_.second, layers[1], first, same);
  fill(network_.output, layers[2], second, same);

  constexpr double close = 1e-5;  // [m]
  for (const auto& check : json.at("checks")) {
    std::array<double, kLinkGeometry + kAnchors + kTags> row{};
    const auto numbers = check.at("inputs").get<Numbers>();
    expect(numbers.size() == inputs, "a check has another number of inputs");
    for (std::size_t i = 0; i < inputs; ++i) row[place(i)] = numbers[i];
    const auto bias = network_(row);
    expect(bias && std::abs(*bias - check.at("bias_m").get<double>()) < close,
           "its biases are not those that its trainer wrote down");
  }
} catch (const Failure&) {
  throw;
} catch (const std::exception& error) {
  throw Failure{fmt::format("{}: {}", file.string(), error.what())};
}

std::optional<double> LinkNetwork::bias(Id tag, Id anchor, const Vec3& offset,
                                        const Mat<double, 3>& map_R_body) const {
  const auto of_anchor = anchors_.find(anchor);
  const auto of_tag = tags_.find(tag);
  if (of_anchor == anchors_.end() || of_tag == tags_.end()) return std::nullopt;
  const auto found = network_(
      link_features<kAnchors, kTags>(offset, map_R_body, of_anchor->second, of_tag->second));
  return found ? std::optional{*found} : std::nullopt;
}

}  // namespace uwbpos::host
