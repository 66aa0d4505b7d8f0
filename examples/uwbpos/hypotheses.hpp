// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Trackers that differ in what they take for granted, fed side by side, and judged by how well
/// each foretold what came: multiple-model estimation (Magill, IEEE Trans. AC 10(4), 1965). How
/// fast the body changes its velocity, how noisy the radio is and where the body looked when an
/// inertial unit was switched on need not be told that way. The score of hypothesis k is
///   (1) \f$ s_k \leftarrow s_k e^{-\Delta t/T} + \ln p_k(z),\quad
///       p_k(z) = (1 - \varepsilon) N(\nu; 0, S) + \varepsilon / w \f$
/// over all measurements z; one that its gate refuses is an outlier, worth ε/w. Causal: nothing is
/// known before its time. For each anchor some do without it, as one that lies from the start can
/// mislead all that begin with it, and some hold that it lies by a length, which they estimate.
/// Once one of these has foretold so much better that there is no doubt, all others are begun anew,
/// some seconds ago, as if they had known. Some hold a radio's errors to be white, others to be
/// mostly biases of the links that change as the body moves, which they estimate: only these know
/// how well they know. Where these lead, each family says half of where the body is, as they err
/// differently (Bates, Granger, Operational Research Quarterly 20(4), 1969), and these how well
/// that is known.

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <variant>
#include <vector>

#include "hypothesis.hpp"

namespace uwbpos::host {

/// Hypotheses of one body.
class HypothesisBank {
 public:
  explicit HypothesisBank(BankOptions options);
  HypothesisBank(const HypothesisBank&) = delete;
  HypothesisBank& operator=(const HypothesisBank&) = delete;
  ~HypothesisBank() = default;

  /// Feeds all; what became of it with the best of them.
  Verdict take(const TimedMeasurement& m);
  void take(std::int64_t time, const InertialReading& sample);

  /// All of them weighed, moments matched, at `time` [µs]. Errors: NotYetLocated, TrackLost;
  /// AmbiguousSolution: one anchor lies or another, and the body is here or there.
  [[nodiscard]] Result<Estimate> at(std::int64_t time);

  /// Whether it is known which anchor lies from the start, if one does.
  [[nodiscard]] bool settled() const { return settled_; }

  /// As the best of them has it.
  [[nodiscard]] std::optional<Vec3> place(Id tag) const;

  /// Whether the best of them uses the inertial unit.
  [[nodiscard]] bool best_is_inertial() const { return best_ && best_->inertial(); }
  /// How often hypotheses on the inertial unit, all worse than one without it, were begun anew.
  [[nodiscard]] std::size_t restarts() const { return restarts_; }

 private:
  // What came, and when.
  struct Heard {
    std::int64_t time;
    std::variant<TimedMeasurement, InertialReading> what;
  };

  void add_bodies();
  void add_points(int dimension);
  void add_inertial();
  void add_suspicious();
  void add_all();
  void remember(const Heard& heard);
  void begin_anew();
  void judge_anchors(std::int64_t time);
  void ignore_liars();
  void note_of_listener(const TimedMeasurement& m, const Verdict& verdict);
  [[nodiscard]] std::optional<Error> withheld(std::int64_t time);
  [[nodiscard]] bool is_early(std::int64_t time) const;
  [[nodiscard]] bool has_rival(std::int64_t time) const;
  void rest(std::int64_t time);
  void weed(std::int64_t time);
  void restart_inertial();
  void choose();

  // What the suspicious hypothesis that listens to all anchors makes of one.
  struct AnchorRecord {
    std::size_t count = 0;
    double refused = 0;  // share of late
  };

  BankOptions options_;
  double extent_ = 0;  // from anchor to anchor [m]
  std::vector<std::unique_ptr<Hypothesis>> all_;
  Hypothesis* best_ = nullptr;
  Hypothesis* listener_ = nullptr;
  std::map<Id, AnchorRecord> records_;
  std::size_t met_ = 0;  // measurements since there was a track
  std::set<Id> heard_;   // anchors
  std::int64_t last_ = 0;
  std::int64_t weeded_ = 0;
  std::int64_t restarted_ = 0;
  std::int64_t begun_ = -1;  // when there was a best one
  std::int64_t judged_ = 0;
  std::set<Id> ignored_;       // anchors that all but suspicious ones ignore
  std::optional<Id> liar_;     // whose lie they estimate
  std::deque<Heard> history_;  // of the last seconds
  std::size_t restarts_ = 0;
  bool fed_by_unit_ = false;
  bool settled_ = false;  // who lies, if anyone does, to begin with
};

}  // namespace uwbpos::host
