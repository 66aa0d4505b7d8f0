// SPDX-License-Identifier: MIT
#include "subnets.hpp"

#include <cmath>
#include <numbers>
#include <optional>

#include <fmt/format.h>

#include "uwbpos/frames/fit_transform.hpp"

#include "failure.hpp"

namespace uwbpos::host {
namespace {

// What the rows of one subnet say.
struct Described {
  std::optional<Id> control_anchor;
  std::optional<SubnetFrame> given;
  std::vector<SharedPoint<double, 2>> points;
  double height_sum = 0;     // of surveyed anchors, map less own frame [m]
  double height_weight = 0;  // number of them
  double sigma = 0;
};

SubnetFrame fitted(const std::string& name, Id id, const Described& described) {
  const auto fit = fit_transform(described.points);
  if (!fit) {
    throw Failure{
        fmt::format("{}: subnet {}: {}; expected its transform, or two surveyed anchors "
                    "or more",
                    name, id, describe(fit.error()))};
  }
  const double n = described.height_weight;
  return {id,
          described.control_anchor.value_or(0),
          fit->a_T_b,
          {described.height_sum / n, described.sigma * described.sigma / n},
          fit->rms};
}

// The control anchor is the subnet's own, and stands at its origin in plan.
void check_control_anchor(const std::string& name, Id subnet, Id control,
                          const std::map<Id, std::size_t>& of_anchor, std::size_t place,
                          const Points& anchors) {
  const auto found = of_anchor.find(control);
  if (found == of_anchor.end() || found->second != place || !anchors.contains(control)) {
    throw Failure{fmt::format("{}: subnet {}: its control anchor {} is none of its anchors", name,
                              subnet, control)};
  }
  constexpr double near = 0.1;  // [m]
  const Vec3& at = anchors.at(control);
  if (at.head<2>().norm() > near) {
    throw Failure{
        fmt::format("{}: subnet {}: its control anchor {} is at ({:.2f}, {:.2f}) m in the anchors "
                    "file; expected it at the origin of the subnet",
                    name, subnet, control, at.x(), at.y())};
  }
}

}  // namespace

SubnetTable read_subnets(const std::filesystem::path& file,
                         const std::filesystem::path& anchors_file, Points& anchors,
                         Problems& problems) {
  enum : std::size_t { kSubnet, kX, kY, kZ, kControl, kYaw, kAnchor, kSigma, kSigmaYaw };
  const std::string name = file.string();
  std::map<Id, Described> subnets;
  const auto columns = {
      Column{"subnet_id", true}, Column{"x_m", true},         Column{"y_m", true},
      Column{"z_m", true},       Column{"control_anchor_id"}, Column{"yaw_deg"},
      Column{"anchor_id"},       Column{"sigma_m"},           Column{"sigma_yaw_deg"}};
  read_csv(file, columns, problems, [&](const Row& row) {
    const Id id = row.id(kSubnet);
    const Vec3 at{row.number(kX), row.number(kY), row.number(kZ)};
    const auto yaw = row.optional_number(kYaw);
    const auto sigma = row.optional_positive(kSigma);
    Described& described = subnets[id];
    if (!row.empty(kControl)) described.control_anchor = row.id(kControl);
    if (yaw.has_value() == !row.empty(kAnchor)) {
      throw std::runtime_error{
          "expected either yaw_deg, a transform, or anchor_id, a shared point"};
    }
    if (yaw) {
      constexpr double degree = std::numbers::pi / 180;
      const double turn = row.optional_positive(kSigmaYaw).value_or(0) * degree;
      const double move = sigma.value_or(0);
      const Vec<double, 3> variances{move * move, move * move, turn * turn};
      if (described.given) throw std::runtime_error{"this subnet's transform was given before"};
      if (!described.points.empty()) {
        throw std::runtime_error{"this subnet was described by shared points before"};
      }
      const auto transform = transform_from_yaw<double, 2>(*yaw * degree, {at.x(), at.y()},
                                                           Mat<double, 3>{variances.asDiagonal()});
      if (!transform) throw std::runtime_error{std::string{describe(transform.error())}};
      described.given = SubnetFrame{id, 0, *transform, {at.z(), move * move}, 0};
      return;
    }
    if (described.given) throw std::runtime_error{"this subnet's transform was given before"};
    const auto anchor = anchors.find(row.id(kAnchor));
    if (anchor == anchors.end()) {
      throw std::runtime_error{"anchor_id: the anchors file does not have it"};
    }
    constexpr double surveyed = 0.05;  // [m]
    const double known = sigma.value_or(surveyed);
    described.points.push_back({anchor->second.head<2>(), at.head<2>(), known});
    described.height_sum += at.z() - anchor->second.z();
    described.height_weight += 1;
    described.sigma = std::max(described.sigma, known);
  });

  SubnetTable table;
  std::map<Id, std::size_t> places;
  for (const auto& [id, described] : subnets) {
    places[id] = table.frames.size();
    table.frames.push_back(described.given ? *described.given : fitted(name, id, described));
    table.frames.back().control_anchor = described.control_anchor.value_or(0);
  }
  if (table.frames.empty() || table.frames.size() > static_cast<std::size_t>(kMostSubnets)) {
    throw Failure{fmt::format("{}: expected 1 to {} subnets, found {}", name, kMostSubnets,
                              table.frames.size())};
  }
  Problems told{false, true};  // of the anchors' file once already
  const auto of_anchor = {Column{"anchor_id", true}, Column{"subnet_id", true}};
  read_csv(anchors_file, of_anchor, told, [&](const Row& row) {
    const auto place = places.find(row.id(1));
    if (place != places.end()) table.of_anchor.emplace(row.id(0), place->second);
  });
  for (const auto& [id, described] : subnets) {
    if (described.control_anchor) {
      check_control_anchor(name, id, *described.control_anchor, table.of_anchor, places.at(id),
                           anchors);
    }
  }
  table.local = anchors;
  std::erase_if(anchors, [&](const auto& entry) { return !table.of_anchor.contains(entry.first); });
  for (auto& [id, position] : anchors) {
    const SubnetFrame& frame = table.frames[table.of_anchor.at(id)];
    const Vec<double, 2> plan = apply(frame.map_T_subnet, Vec<double, 2>{position.head<2>()});
    position = {plan.x(), plan.y(), position.z() + frame.height.value};
  }
  if (anchors.empty()) {
    throw Failure{
        fmt::format("{}: no anchor belongs to a subnet of {}", anchors_file.string(), name)};
  }
  return table;
}

}  // namespace uwbpos::host
