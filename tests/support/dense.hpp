// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Matrices of any size in double, for tests that solve a problem the slow and obvious way:
/// compiled in a moment, where Eigen's dynamic products and inverses take seconds a test.

#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "uwbpos/core/types.hpp"

namespace uwbpos::test {

/// A matrix stored by rows, zero at first.
class Dense {
 public:
  /// `rows` × `columns` zeros.
  Dense(std::size_t rows, std::size_t columns)
      : rows_{rows}, columns_{columns}, values_(rows * columns) {}

  double& operator()(std::size_t i, std::size_t j) { return values_[i * columns_ + j]; }
  double operator()(std::size_t i, std::size_t j) const { return values_[i * columns_ + j]; }
  [[nodiscard]] std::size_t rows() const { return rows_; }
  [[nodiscard]] std::size_t columns() const { return columns_; }

  /// Writes a fixed-size matrix or vector with its corner at (row, column).
  template <class Derived>
  void put(std::size_t row, std::size_t column, const Eigen::MatrixBase<Derived>& block) {
    for (int i = 0; i < Derived::RowsAtCompileTime; ++i) {
      for (int j = 0; j < Derived::ColsAtCompileTime; ++j) {
        (*this)(row + static_cast<std::size_t>(i), column + static_cast<std::size_t>(j)) =
            static_cast<double>(block(i, j));
      }
    }
  }

 private:
  std::size_t rows_;
  std::size_t columns_;
  std::vector<double> values_;
};

inline Dense operator*(const Dense& a, const Dense& b) {
  Dense c{a.rows(), b.columns()};
  for (std::size_t i = 0; i < a.rows(); ++i) {
    for (std::size_t k = 0; k < a.columns(); ++k) {
      for (std::size_t j = 0; j < b.columns(); ++j) c(i, j) += a(i, k) * b(k, j);
    }
  }
  return c;
}

inline Dense operator-(Dense a, const Dense& b) {
  for (std::size_t i = 0; i < a.rows(); ++i) {
    for (std::size_t j = 0; j < a.columns(); ++j) a(i, j) -= b(i, j);
  }
  return a;
}

inline Dense transposed(const Dense& a) {
  Dense t{a.columns(), a.rows()};
  for (std::size_t i = 0; i < a.rows(); ++i) {
    for (std::size_t j = 0; j < a.columns(); ++j) t(j, i) = a(i, j);
  }
  return t;
}

/// By Gauss and Jordan, with row pivots.
inline Dense inverse(Dense a) {
  const std::size_t n = a.rows();
  Dense b{n, n};
  for (std::size_t i = 0; i < n; ++i) b(i, i) = 1;
  for (std::size_t c = 0; c < n; ++c) {
    std::size_t pivot = c;
    for (std::size_t i = c; i < n; ++i) {
      if (std::abs(a(i, c)) > std::abs(a(pivot, c))) pivot = i;
    }
    const double scale = 1 / a(pivot, c);
    for (std::size_t j = 0; j < n; ++j) {
      std::swap(a(c, j), a(pivot, j));
      std::swap(b(c, j), b(pivot, j));
      a(c, j) *= scale;
      b(c, j) *= scale;
    }
    for (std::size_t i = 0; i < n; ++i) {
      if (i == c) continue;
      const double factor = a(i, c);
      for (std::size_t j = 0; j < n; ++j) {
        a(i, j) -= factor * a(c, j);
        b(i, j) -= factor * b(c, j);
      }
    }
  }
  return b;
}

}  // namespace uwbpos::test
