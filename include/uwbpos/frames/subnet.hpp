// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The subnets of a site, each with its own control anchor at the origin of its own frame, and what
/// is known of how they lie in the one map.

#include <array>
#include <cstdint>

#include "uwbpos/core/covariance.hpp"
#include "uwbpos/frames/joint_fix.hpp"
#include "uwbpos/frames/make_transform.hpp"

namespace uwbpos {

/// One subnet of a site.
template <class S, int D>
struct Subnet {
  std::uint32_t id;              ///< what fixes and logs call it
  std::uint32_t control_anchor;  ///< the anchor at the origin of its frame
  /// Takes its frame to the map; its translation is where the control anchor is.
  Transform<S, D> map_T_subnet;
};

/// The variance of a rotation (trace of C_θ) above which errors of the first order say too little
/// [rad²]: that of 0.25 rad.
template <class S>
inline constexpr S kMaxTurnVariance = S(0.0625);

/// Up to `Capacity` subnets, in the order in which they were added, and the joint covariance of
/// their transforms' errors: (`Capacity` · 3)² scalars in the plane, (`Capacity` · 6)² in space.
/// Transforms are taken to err independently when added; `absorb` makes their errors known to each
/// other. Never allocates.
template <class S, int D, int Capacity = 8>
class Subnets {
  static_assert(Capacity > 0, "room for one subnet at least");
  static constexpr int kDof = kTransformDof<D>;

 public:
  /// The most subnets that fit.
  static constexpr int kCapacity = Capacity;

  /// Adds a subnet; O(n). On an error nothing changes. Errors: NotFinite; NotARotation;
  /// InvalidCovariance; RotationUndetermined, above `kMaxTurnVariance`; DuplicateSubnet (id);
  /// CapacityExceeded.
  [[nodiscard]] Result<void> add(const Subnet<S, D>& subnet) {
    const Transform<S, D>& given = subnet.map_T_subnet;
    const Result<Transform<S, D>> checked =
        transform_from_rotation<S, D>(given.rotation, given.translation, given.covariance);
    if (!checked) return std::unexpected(checked.error());
    if (given.covariance.template bottomRightCorner<kTurnDof<D>, kTurnDof<D>>().trace() >
        kMaxTurnVariance<S>) {
      return std::unexpected(Error::RotationUndetermined);
    }
    if (place(subnet.id)) return std::unexpected(Error::DuplicateSubnet);
    if (size_ == Capacity) return std::unexpected(Error::CapacityExceeded);
    entries_[static_cast<std::size_t>(size_)] = {subnet.id, subnet.control_anchor, *checked};
    covariance_.template block<kDof, kDof>(size_ * kDof, size_ * kDof) = checked->covariance;
    ++size_;
    return {};
  }

  /// Where in the order the subnet with this id stands; O(n). Errors: UnknownSubnet.
  [[nodiscard]] Result<int> place(std::uint32_t id) const {
    for (int i = 0; i < size_; ++i) {
      if ((*this)[i].id == id) return i;
    }
    return std::unexpected(Error::UnknownSubnet);
  }

  /// The subnet with this id, its transform as known by now; O(n). Errors: UnknownSubnet.
  [[nodiscard]] Result<Subnet<S, D>> find(std::uint32_t id) const {
    const Result<int> found = place(id);
    if (!found) return std::unexpected(found.error());
    return (*this)[*found];
  }

  /// How many subnets there are.
  [[nodiscard]] int size() const { return size_; }
  /// Whether there are none.
  [[nodiscard]] bool empty() const { return size_ == 0; }
  /// The subnets in the order in which they were added, one contiguous range.
  [[nodiscard]] const Subnet<S, D>* begin() const { return entries_.data(); }
  /// One past the last of them.
  [[nodiscard]] const Subnet<S, D>* end() const { return entries_.data() + size_; }
  /// The subnet at a place in that order, 0 ≤ index < size().
  [[nodiscard]] const Subnet<S, D>& operator[](int index) const { return begin()[index]; }

  /// Covariance of the transforms' errors at two places, 0 ≤ i, j < size() [m², m·rad, rad²].
  [[nodiscard]] Mat<S, kDof> covariance(int i, int j) const {
    return covariance_.template block<kDof, kDof>(i * kDof, j * kDof);
  }

  /// What is known of all errors: mean zero, and their joint covariance; of places beyond `size()`
  /// nothing but zeros.
  [[nodiscard]] TransformErrors<S, D, Capacity> errors() const {
    TransformErrors<S, D, Capacity> all;
    all.covariance = covariance_;
    return all;
  }

  /// Corrects every transform by an estimate of all errors, and keeps the covariance that is left.
  /// O(n³), and as much stack as the covariance. Errors: NumericOverflow, an estimate that is not
  /// finite or has a negative variance; then nothing changes.
  [[nodiscard]] Result<void> absorb(const TransformErrors<S, D, Capacity>& errors) {
    if (!all_finite(errors.mean) || !all_finite(errors.covariance) ||
        !(errors.covariance.diagonal().minCoeff() >= S(0))) {
      return std::unexpected(Error::NumericOverflow);
    }
    covariance_ = errors.covariance;
    remove_rounding<S, Capacity * kDof>(covariance_);
    for (int i = 0; i < size_; ++i) {
      Transform<S, D>& map_T_subnet = entries_[static_cast<std::size_t>(i)].map_T_subnet;
      map_T_subnet =
          corrected(map_T_subnet, Vec<S, kDof>{errors.mean.template segment<kDof>(i * kDof)});
      map_T_subnet.covariance = covariance(i, i);
    }
    return {};
  }

 private:
  std::array<Subnet<S, D>, static_cast<std::size_t>(Capacity)> entries_{};
  Mat<S, Capacity * kDof> covariance_ = Mat<S, Capacity * kDof>::Zero();
  int size_ = 0;
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
