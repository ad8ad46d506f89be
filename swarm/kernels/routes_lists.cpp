#include "routes_lists.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace peckorder {

TimedLists::TimedLists(const RouteTerms& terms)
    : terms_(&terms),
      list_of_(terms.n_task(), -1),
      place_of_(terms.n_task(), 0) {}

void TimedLists::load(const std::vector<Route>& routes, const std::vector<int>& uavs) {
  std::fill(list_of_.begin(), list_of_.end(), -1);
  uav_of_list_ = uavs;
  if (terms_->leaves_out()) uav_of_list_.push_back(-1);
  const std::size_t n = uav_of_list_.size();
  lists_.assign(n, {});
  worth_.assign(n, 0.0);
  own_.assign(n, {});
  foreign_.assign(n, std::vector<Flight>(n));
  for (std::size_t list = 0; list < uavs.size(); ++list)
    replace(static_cast<int>(list), routes[uavs[list]]);
  if (!terms_->leaves_out()) return;
  Route left_out;
  for (int task = 0; task < terms_->n_task(); ++task)
    if (list_of_[task] < 0) left_out.push_back(task);
  replace(static_cast<int>(n) - 1, left_out);
}

void TimedLists::replace(int list, const Route& route) {
  Route& now = lists_[list];
  const std::size_t most = std::min(now.size(), route.size());
  int from = 0;
  while (from < static_cast<int>(most) && now[from] == route[from]) ++from;
  now.resize(route.size());
  for (std::size_t k = from; k < route.size(); ++k) {
    now[k] = route[k];
    list_of_[now[k]] = list;
    place_of_[now[k]] = static_cast<int>(k);
  }
  if (is_left_out(list)) return;
  for (Flight& flight : foreign_[list]) flight.known = false;
  fly(own_[list], now, uav(list), true, from);
  worth_[list] = now.empty() ? 0.0 : own_[list].sums.back().worth;
}

void TimedLists::fly(Flight& flight, const Route& route, int uav, bool own, int from) const {
  const int size = static_cast<int>(route.size());
  flight.sums.resize(size);
  flight.known = true;
  if (!own) {
    flight.capable_from = size;
    while (flight.capable_from > 0 && terms_->capable(uav, route[flight.capable_from - 1]))
      --flight.capable_from;
    from = flight.capable_from;
  }
  Sums sums;
  if (own && from > 0) sums = flight.sums[from - 1];
  for (int k = from; k < size; ++k) {
    const int task = route[k];
    if (k > (own ? 0 : flight.capable_from)) {
      sums.time_s += terms_->leg_s(uav, route[k - 1], task);
      sums.back_s += terms_->leg_s(uav, task, route[k - 1]);
    } else {
      sums.time_s = own ? terms_->first_s(uav, task) : 0.0;
      sums.back_s = 0.0;
    }
    const double weight = terms_->weight(uav, task);
    const double prize = weight * terms_->due_s(task);
    sums.weight += weight;
    sums.worth += prize - weight * sums.time_s;
    sums.turned += prize + weight * sums.back_s;
    flight.sums[k] = sums;
  }
}

// As the UAV of list `to` flies it.
const TimedLists::Flight& TimedLists::flight(int list, int to) {
  if (list == to || terms_->alike(uav(list), uav(to))) return own_[list];
  Flight& found = foreign_[list][to];
  if (!found.known) fly(found, lists_[list], uav(to), false, 0);
  return found;
}

Segment TimedLists::part(const Flight& flight, const Route& route, const Piece& piece) const {
  const Sums& first = flight.sums[piece.begin];
  const Sums& last = flight.sums[piece.end - 1];
  static constexpr Sums kNone{};
  const Sums& before =
      piece.begin > flight.capable_from ? flight.sums[piece.begin - 1] : kNone;
  const double weight = last.weight - before.weight;
  if (piece.turned)
    return {route[piece.end - 1], route[piece.begin], last.back_s - first.back_s,
            last.turned - before.turned - weight * last.back_s, weight, 1.0};
  return {route[piece.begin], route[piece.end - 1], last.time_s - first.time_s,
          last.worth - before.worth + weight * first.time_s, weight, 1.0};
}

bool TimedLists::append(Cursor& cursor, int list, const Piece& piece) {
  const int uav = this->uav(list);
  const Route& route = lists_[piece.list];
  if (piece.list == list && piece.begin == 0 && !piece.turned && cursor.last < 0) {
    const Sums& sums = own_[list].sums[piece.end - 1];
    cursor = {route[piece.end - 1], sums.time_s, sums.worth};
    return true;
  }
  Segment segment;
  if (is_left_out(piece.list)) {  // one task at a time
    const int task = route[piece.begin];
    if (!terms_->capable(uav, task)) return false;
    const double weight = terms_->weight(uav, task);
    segment = {task, task, 0.0, weight * terms_->due_s(task), weight, 1.0};
  } else {
    const Flight& flown = flight(piece.list, list);
    if (piece.begin < flown.capable_from) {
      for (int k = piece.begin; k < piece.end; ++k) {
        const int task = piece.turned ? route[piece.end - 1 - (k - piece.begin)] : route[k];
        if (!terms_->capable(uav, task)) return false;
        const double weight = terms_->weight(uav, task);
        const Segment one{task, task, 0.0, weight * terms_->due_s(task), weight, 1.0};
        segment = segment.empty() ? one
                                  : joined(segment, one, terms_->leg_s(uav, segment.last, task));
      }
    } else {
      segment = part(flown, route, piece);
    }
  }
  const double first_s = cursor.last < 0
                             ? terms_->first_s(uav, segment.first)
                             : cursor.time_s + terms_->leg_s(uav, cursor.last, segment.first);
  cursor.worth += segment.worth(first_s);
  cursor.time_s = first_s + segment.duration_s;
  cursor.last = segment.last;
  return true;
}

double TimedLists::gain(const Recipe& recipe) {
  double gain = 0.0;
  for (int k = 0; k < recipe.lists; ++k) {
    const int list = recipe.list[k];
    if (is_left_out(list)) continue;
    Cursor cursor;
    for (int p = 0; p < recipe.pieces[k]; ++p)
      if (!append(cursor, list, recipe.piece[k][p]))
        return -std::numeric_limits<double>::infinity();
    gain += cursor.worth - worth_[list];
  }
  return gain;
}

double TimedLists::insertion_gain(int list, int place, int task) const {
  const int uav = this->uav(list);
  if (!terms_->capable(uav, task)) return -std::numeric_limits<double>::infinity();
  const Route& route = lists_[list];
  const std::vector<Sums>& sums = own_[list].sums;
  const double completion_s =
      place == 0 ? terms_->first_s(uav, task)
                 : sums[place - 1].time_s + terms_->leg_s(uav, route[place - 1], task);
  const double weight = terms_->weight(uav, task);
  double gain = weight * (terms_->due_s(task) - completion_s);
  if (place < size(list)) {
    const double delay_s =
        completion_s + terms_->leg_s(uav, task, route[place]) - sums[place].time_s;
    const double before = place == 0 ? 0.0 : sums[place - 1].weight;
    gain -= delay_s * (sums.back().weight - before);
  }
  return gain;
}

void TimedLists::compose(const Recipe& recipe, int k) {
  Route& route = composed_[k];
  route.clear();
  for (int p = 0; p < recipe.pieces[k]; ++p) {
    const Piece& piece = recipe.piece[k][p];
    const Route& from = lists_[piece.list];
    if (piece.turned)
      route.insert(route.end(), from.rend() - piece.end, from.rend() - piece.begin);
    else
      route.insert(route.end(), from.begin() + piece.begin, from.begin() + piece.end);
  }
}

double TimedLists::total() const {
  double sum = 0.0;
  for (const double worth : worth_) sum += worth;
  return sum;
}

double TimedLists::added_up() const {
  double sum = 0.0;
  for (int list = 0; list < n_list(); ++list) {
    if (is_left_out(list)) continue;
    for (const int task : lists_[list])
      sum += terms_->weight(uav(list), task) * std::abs(terms_->due_s(task));
    if (!lists_[list].empty()) {
      const Sums& all = own_[list].sums.back();
      sum += all.weight * (std::abs(all.time_s) + all.back_s);
    }
  }
  return sum;
}

double TimedLists::mean_delay() const {
  double sum = 0.0;
  int count = 0;
  for (int list = 0; list < n_list(); ++list) {
    if (is_left_out(list) || lists_[list].empty()) continue;
    const double start_s = terms_->start().free_s[uav(list)];
    for (std::size_t k = 0; k < lists_[list].size(); ++k, ++count)
      sum += terms_->weight(uav(list), lists_[list][k]) * (own_[list].sums[k].time_s - start_s);
  }
  return count == 0 ? 0.0 : sum / count;
}

}  // namespace peckorder
