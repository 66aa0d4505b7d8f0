// SPDX-License-Identifier: MIT
// Times of contenders taken in turns, so that what disturbs one disturbs all.
#pragma once
#include <algorithm>
#include <chrono>
#include <cstddef>
#include <functional>
#include <vector>

namespace peers {

template <class T>
void keep(const T& value) {
  asm volatile("" : : "g"(&value) : "memory");
}

inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Does its work `calls` times.
struct Contender {
  std::size_t calls;
  std::function<void()> work;
};

struct Times {
  std::vector<double> nanoseconds;  // a call of each, median
  std::vector<double> ratios;       // to the first, median of each round's
};

inline Times race(const std::vector<Contender>& contenders, int rounds = 31) {
  using Clock = std::chrono::steady_clock;
  std::vector<std::vector<double>> times(contenders.size());
  std::vector<std::vector<double>> ratios(contenders.size());
  for (const Contender& c : contenders) c.work();  // warm
  for (int round = 0; round < rounds; ++round) {
    double first = 0;
    for (std::size_t i = 0; i < contenders.size(); ++i) {
      const auto begin = Clock::now();
      contenders[i].work();
      const std::chrono::duration<double, std::nano> spent = Clock::now() - begin;
      const double each = spent.count() / static_cast<double>(contenders[i].calls);
      if (i == 0) first = each;
      times[i].push_back(each);
      ratios[i].push_back(each / first);
    }
  }
  Times result;
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    result.nanoseconds.push_back(median(times[i]));
    result.ratios.push_back(median(ratios[i]));
  }
  return result;
}

}  // namespace peers
