// Lists in time, any part of which is known in O(1) from sums from the list's front.
//
// Only where nobody is lost: then sums over a part are differences of sums. A part turned round, or
// flown by another UAV, is known as quickly. Tasks that may be left out stand on one list more, the
// last, on which they are worth nothing.
#pragma once

#include <vector>

#include "routes_terms.hpp"
#include "segment.hpp"

namespace peckorder {

// Tasks begin..end-1 of a list, or these from the last to the first.
struct Piece {
  int list, begin, end;
  bool turned;

  int size() const { return end - begin; }
};

// Lists flown anew, each as pieces of the present ones; at most two lists of five pieces.
struct Recipe {
  static constexpr int kMostPieces = 5;

  double gain = 0.0;
  int lists = 0;
  int list[2], pieces[2];
  Piece piece[2][kMostPieces];  // only so many of them are set

  void begin(int of) {
    list[lists] = of;
    pieces[lists++] = 0;
  }
  void add(int from, int first, int last, bool turned = false) {
    if (first < last) piece[lists - 1][pieces[lists - 1]++] = {from, first, last, turned};
  }
};

class TimedLists {
 public:
  explicit TimedLists(const RouteTerms& terms);

  // Forget all; fly the lists of these UAVs alone. What may be left out and is on none of them is.
  void load(const std::vector<Route>& routes, const std::vector<int>& uavs);

  const RouteTerms& terms() const { return *terms_; }
  int n_list() const { return static_cast<int>(lists_.size()); }
  bool is_left_out(int list) const { return uav_of_list_[list] < 0; }
  int uav(int list) const { return uav_of_list_[list]; }
  const Route& route(int list) const { return lists_[list]; }
  int size(int list) const { return static_cast<int>(lists_[list].size()); }
  int list_of(int task) const { return list_of_[task]; }  // -1: on none of them
  int place_of(int task) const { return place_of_[task]; }
  double worth(int list) const { return worth_[list]; }
  double total() const;
  // Σ of the sizes of all that is added up to a list's worth: rounding goes by it, not by the worth.
  double added_up() const;
  double mean_delay() const;  // mean over tasks of weight · (t − start)

  // Worth of `recipe`'s lists less that of the present ones; −infinity if a UAV is not capable.
  double gain(const Recipe& recipe);

  // `keep` is told each list before it changes.
  template <class Keep>
  void apply(const Recipe& recipe, Keep&& keep) {
    for (int k = 0; k < recipe.lists; ++k) compose(recipe, k);
    for (int k = 0; k < recipe.lists; ++k) {
      keep(recipe.list[k]);
      replace(recipe.list[k], composed_[k]);
    }
  }
  void replace(int list, const Route& route);
  void forget(int task) { list_of_[task] = -1; }  // it is on no list any more

  // Gain of inserting `task`, which is on no list, before `place`.
  double insertion_gain(int list, int place, int task) const;

 private:
  struct Sums {  // over tasks 0..k of a list
    double time_s = 0.0;    // completion of task k
    double back_s = 0.0;    // from completing task k to completing task 0 the other way round
    double weight = 0.0;
    double worth = 0.0;     // Σ prize − weight · time
    double turned = 0.0;    // Σ prize + weight · back
  };
  // A list as some UAV flies it; the time of another UAV's begins at its first task.
  struct Flight {
    std::vector<Sums> sums;
    int capable_from = 0;  // of all tasks from here on
    bool known = false;
  };
  struct Cursor {
    int last = -1;
    double time_s = 0.0;
    double worth = 0.0;
  };

  const Flight& flight(int list, int to);
  void fly(Flight& flight, const Route& route, int uav, bool own, int from) const;
  Segment part(const Flight& flight, const Route& route, const Piece& piece) const;
  bool append(Cursor& cursor, int list, const Piece& piece);
  void compose(const Recipe& recipe, int k);

  const RouteTerms* terms_;
  std::vector<int> uav_of_list_;
  std::vector<Route> lists_;
  std::vector<double> worth_;
  std::vector<Flight> own_;
  std::vector<std::vector<Flight>> foreign_;  // [list][list whose UAV flies it]
  std::vector<int> list_of_, place_of_;
  Route composed_[2];
};

}  // namespace peckorder
