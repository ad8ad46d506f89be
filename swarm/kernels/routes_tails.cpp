#include "routes_tails.hpp"

#include <algorithm>

namespace peckorder {

namespace {
constexpr std::size_t kMostBorn = 300'000;
}  // namespace

Tails::Tails(const Offer& offer, Watch& watch)
    : offer_(offer), lines_(offer.n()), coming_(offer.n()) {
  const int n = offer_.n();
  for (int i = 0; i < n; ++i) {
    const double w = offer_.weight[i];
    lines_[i].push_back({w * offer_.left_s - offer_.price[i], w, 1, i});
    nodes_.push_back({i, -1});
    coming_[i] = lines_[i];
  }
  // In round r those of r tasks; a real list has n at most.
  for (int round = 1; round < n; ++round) {
    std::vector<std::vector<Line>> fresh(n);
    fresh.swap(coming_);
    bool any = false;
    for (int i = 0; i < n; ++i) {
      for (const Line& line : fresh[i]) {
        if (extend(i, line, watch)) any = true;
        if (overflown_ || watch.stopped()) return;
      }
    }
    if (!any) return;
    for (int i = 0; i < n; ++i)
      if (!coming_[i].empty()) tidy(i, watch);
  }
}

void Tails::append_best(int i, double time_s, Memory known, Route& list) const {
  double best = offer_.gain(i, time_s);
  int at = -1;
  for (const Line& line : lines_[i]) {
    const double earned = line.a - line.w * time_s;
    if ((line.known & known & ~Memory{1}) != 0 || !(earned > best)) continue;
    best = earned;
    at = line.born;
  }
  if (at < 0) return;
  for (int k = nodes_[at].next; k >= 0; k = nodes_[k].next)
    list.push_back(offer_.tasks[nodes_[k].task]);
}

Tails::Span Tails::useful(int i, const Line& line, Span span, bool sort) {
  if (span.empty()) return span;
  double low = line.a - line.w * span.from_s, high = line.a - line.w * span.until_s;
  std::vector<Line>& lines = lines_[i];
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const Line& other = lines[k];
    if ((other.known & ~line.known) != 0 || other.born == line.born) continue;
    const double more_low = low - (other.a - other.w * span.from_s);
    const double more_high = high - (other.a - other.w * span.until_s);
    if (more_low > 0.0 && more_high > 0.0) continue;
    if (more_low <= 0.0 && more_high <= 0.0) {
      const bool equal = more_low == 0.0 && more_high == 0.0 && other.known == line.known;
      if (equal && line.born < other.born) continue;  // of equals the older one stays
      if (sort) std::swap(lines[k], lines[k / 2]);
      return {0.0, -1.0};
    }
    const double cross_s = (line.a - other.a) / (line.w - other.w);
    if (more_low > 0.0) {
      span.until_s = std::min(span.until_s, cross_s);
      high = line.a - line.w * span.until_s;
    } else {
      span.from_s = std::max(span.from_s, cross_s);
      low = line.a - line.w * span.from_s;
    }
    if (span.empty()) return span;
  }
  return span;
}

bool Tails::extend(int i, const Line& line, Watch& watch) {
  std::int64_t steps = steps_among(i);
  const Span span = useful(i, line, {offer_.first_s[i], offer_.latest_s[i]});
  if (span.empty()) {
    watch.stops_after(steps);
    return false;
  }
  // From a / w on it is worth nothing, and the task before it does better as the last one.
  const double until_s = std::min(span.until_s, line.a / line.w);
  bool any = false;
  for (const Offer::Arc* arc = offer_.arcs_begin(i); arc != offer_.arcs_end(i); ++arc) {
    if (arc->reach_s >= until_s) break;
    const int h = arc->from;
    if (offer_.knows(line.known, i, h, offer_.tail_memory(i))) continue;
    const double leg_s = arc->reach_s - offer_.first_s[h], w = offer_.weight[h];
    const Span own{std::max(offer_.first_s[h], span.from_s - leg_s),
                   std::min(offer_.latest_s[h], until_s - leg_s)};
    if (own.empty()) continue;
    const Line longer{line.a - line.w * leg_s + w * offer_.left_s - offer_.price[h], line.w + w,
                      offer_.moved(line.known, i, h, offer_.tail_memory(h)),
                      static_cast<int>(nodes_.size())};
    steps += steps_among(h);
    if (useful(h, longer, own).empty()) continue;
    nodes_.push_back({h, line.born});
    if (nodes_.size() > kMostBorn) overflown_ = true;
    lines_[h].push_back(longer);
    coming_[h].push_back(longer);
    any = true;
  }
  watch.stops_after(steps);
  return any && !overflown_;
}

// Drops lines that others have overtaken.
void Tails::tidy(int i, Watch& watch) {
  std::vector<Line>& lines = lines_[i];
  const int oldest_coming = coming_[i].front().born;
  coming_[i].clear();
  for (std::size_t k = 0; k < lines.size();) {
    if (watch.stops_after(steps_among(i))) return;
    if (useful(i, lines[k], {offer_.first_s[i], offer_.latest_s[i]}, false).empty()) {
      lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(k));
      continue;
    }
    if (lines[k].born >= oldest_coming) coming_[i].push_back(lines[k]);
    ++k;
  }
}

}  // namespace peckorder
