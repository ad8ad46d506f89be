// Parts of a route that are joined in constant time (eq. 1 with survival).
//
// If the first task of a segment is complete at time τ and the UAV survives until then with
// probability S, the segment contributes S · (constant − slope · τ). Both numbers, the duration
// and the survival of a concatenation follow from those of its parts, as for the
// minimum-latency problem (Silva et al. 2012, doi:10.1016/j.ejor.2012.03.044; Vidal et al.
// 2014, doi:10.1016/j.ejor.2013.09.045); survival multiplies what comes after it.
#pragma once

namespace peckorder {

struct Segment {
  int first = -1;         // task index; -1: the segment is empty
  int last = -1;
  double duration_s = 0;  // from the first task's completion to the last one's
  double constant = 0;    // Σ σ·w·(D − time after the first completion)
  double slope = 0;       // Σ σ·w
  double survival = 1;    // of all its tasks

  bool empty() const { return first < 0; }

  double worth(double first_completion_s) const { return constant - slope * first_completion_s; }
};

// A task of weight p·m by itself.
inline Segment single(int task, double weight, double survival, double horizon_s) {
  return {task, task, 0.0, weight * horizon_s, weight, survival};
}

// `a` then `b`, neither empty; leg_s from completing a's last task to completing b's first.
inline Segment joined(const Segment& a, const Segment& b, double leg_s) {
  const double shift_s = a.duration_s + leg_s;
  return {a.first,
          b.last,
          shift_s + b.duration_s,
          a.constant + a.survival * (b.constant - b.slope * shift_s),
          a.slope + a.survival * b.slope,
          a.survival * b.survival};
}

}  // namespace peckorder
