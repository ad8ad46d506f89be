// Subset dynamic programming over tours; see tours.hpp. Survival 1: a backward recursion in which
// each leg costs its time × the weight still open. Survival below 1: label setting, since the worth
// of a tour is linear in the time of its first completion.
#include "tours.hpp"

#include <algorithm>
#include <limits>

#include "arrays.hpp"
#include "bindings.hpp"

namespace peckorder {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

TourTable::TourTable(int n, const double* weight, const double* survival, const double* leg_s,
                     double horizon_s, Watch& watch)
    : n_(n), certain_(true), horizon_s_(horizon_s), leg_s_(leg_s, leg_s + n * n) {
    for (int i = 0; i < n; ++i) certain_ = certain_ && survival[i] == 1.0;
    if (certain_) {
        build_costs(weight, watch);
    } else {
        build_labels(weight, survival, watch);
    }
}

std::size_t TourTable::bytes() const {
    return sizeof(double) * (leg_s_.size() + total_.size() + cost_.size()) +
           sizeof(std::uint64_t) * offset_.size() + sizeof(Label) * labels_.size();
}

void TourTable::build_costs(const double* weight, Watch& watch) {
    const std::size_t n = static_cast<std::size_t>(n_), sets = std::size_t{1} << n_;
    total_.assign(sets, 0.0);
    for (std::size_t i = 0; i < n; ++i) {  // every sum is added in ascending order of position
        const std::size_t bit = std::size_t{1} << i;
        for (std::size_t s = 0; s < bit; ++s) total_[bit | s] = total_[s] + weight[i];
    }
    std::vector<double> leg_to(n * n);  // [j * n + i]: from i to j
    for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = 0; j < n; ++j) leg_to[j * n + i] = leg_s_[i * n + j];
    }
    cost_.assign(sets * n, kInfinity);
    std::fill(cost_.begin(), cost_.begin() + n_, 0.0);
    for (std::size_t s = 1; s < sets; ++s) {
        if (watch.stops_after(static_cast<std::int64_t>(n * n / 8))) return;
        double* row = &cost_[s * n];
        for (std::size_t first = 0; first < n; ++first) {
            if (!(s >> first & 1)) continue;
            const double rest = cost_[(s ^ std::size_t{1} << first) * n + first];
            const double* leg = &leg_to[first * n];
            for (std::size_t k = 0; k < n; ++k) {
                const double candidate = total_[s] * leg[k] + rest;
                row[k] = candidate < row[k] ? candidate : row[k];
            }
        }
    }
}

void TourTable::build_labels(const double* weight, const double* survival, Watch& watch) {
    const std::size_t n = static_cast<std::size_t>(n_), sets = std::size_t{1} << n_;
    offset_.assign(sets * n + 1, 0);
    std::vector<Label> candidates;
    for (std::size_t s = 1; s < sets; ++s) {
        for (std::size_t first = 0; first < n; ++first) {
            const std::size_t state = s * n + first;
            if (s >> first & 1) {
                const std::size_t rest = s ^ std::size_t{1} << first;
                candidates.clear();
                if (rest == 0) candidates.push_back({weight[first] * horizon_s_, weight[first]});
                for (std::size_t second = 0; second < n; ++second) {
                    if (!(rest >> second & 1)) continue;
                    const double leg = leg_s_[first * n + second];
                    const std::size_t from = offset_[rest * n + second];
                    const std::size_t to = offset_[rest * n + second + 1];
                    for (std::size_t i = from; i < to; ++i) {
                        const Label& label = labels_[i];
                        const double constant = label.constant - label.slope * leg;
                        candidates.push_back({weight[first] * horizon_s_ + survival[first] * constant,
                                              weight[first] + survival[first] * label.slope});
                    }
                }
                if (watch.stops_after(static_cast<std::int64_t>(8 * candidates.size()))) return;
                keep_envelope(candidates);
                labels_.insert(labels_.end(), candidates.begin(), candidates.end());
            }
            offset_[state + 1] = labels_.size();
        }
    }
    labels_.shrink_to_fit();
}

// Only labels that are the best one for some τ >= 0, by ascending slope.
void TourTable::keep_envelope(std::vector<Label>& candidates) {
    if (candidates.size() < 2) return;
    std::sort(candidates.begin(), candidates.end(), [](const Label& a, const Label& b) {
        return a.slope != b.slope ? a.slope < b.slope : a.constant > b.constant;
    });
    std::size_t kept = 0;
    for (const Label label : candidates) {
        if (kept > 0 && !(label.constant > candidates[kept - 1].constant)) continue;
        while (kept >= 2) {
            const Label& a = candidates[kept - 2];
            const Label& b = candidates[kept - 1];
            if ((label.constant - b.constant) * (b.slope - a.slope) <
                (b.constant - a.constant) * (label.slope - b.slope)) {
                break;
            }
            --kept;
        }
        candidates[kept++] = label;
    }
    candidates.resize(kept);
}

void TourTable::first_values(std::uint32_t mask, const double* completion_s, double* values) const {
    const std::size_t n = static_cast<std::size_t>(n_), s = mask;
    for (std::size_t first = 0; first < n; ++first) {
        values[first] = -kInfinity;
        if (!(s >> first & 1)) continue;
        const double time_s = completion_s[first];
        if (certain_) {
            const double rest = cost_[(s ^ std::size_t{1} << first) * n + first];
            values[first] = total_[s] * (horizon_s_ - time_s) - rest;
            continue;
        }
        for (std::size_t i = offset_[s * n + first]; i < offset_[s * n + first + 1]; ++i) {
            const double worth = labels_[i].constant - labels_[i].slope * time_s;
            values[first] = worth > values[first] ? worth : values[first];
        }
    }
}

void TourTable::values(const double* completion_s, double* best, Watch& watch) const {
    double by_first[kMostTasks];
    best[0] = 0.0;
    for (std::uint32_t mask = 1; mask < std::uint32_t{1} << n_; ++mask) {
        if (watch.stops_after(n_)) return;
        first_values(mask, completion_s, by_first);
        best[mask] = *std::max_element(by_first, by_first + n_);
    }
}

std::vector<int> TourTable::best_tour(std::uint32_t mask, const double* completion_s) const {
    std::vector<int> tour;
    double times_s[kMostTasks], by_first[kMostTasks];
    std::copy(completion_s, completion_s + n_, times_s);
    while (mask) {
        first_values(mask, times_s, by_first);
        int first = -1;
        for (int i = 0; i < n_; ++i) {
            if (mask >> i & 1 && (first < 0 || by_first[i] > by_first[first])) first = i;
        }
        tour.push_back(first);
        mask ^= std::uint32_t{1} << first;
        const double now_s = times_s[first];
        for (int i = 0; i < n_; ++i) times_s[i] = now_s + leg_s_[first * n_ + i];
    }
    return tour;
}

void bind_tours(nb::module_& module) {
    nb::class_<TourTable>(module, "TourTable")
        .def(
            "__init__",
            [](TourTable* self, In<double, 1> weight, In<double, 1> survival, In<double, 2> leg_s,
               double horizon_s) {
                const std::size_t n = weight.shape(0);
                require_shape("survival", survival, {n});
                require_shape("leg_s", leg_s, {n, n});
                require_finite("weight", weight.data(), n);
                require_finite("leg_s", leg_s.data(), n * n);
                require_finite("horizon_s", &horizon_s, 1);
                bool certain = true;
                for (std::size_t i = 0; i < n; ++i) {
                    require_within("survival", survival.data()[i], 0.0, 1.0, "within 0..1");
                    certain = certain && survival.data()[i] == 1.0;
                }
                const int most = certain ? TourTable::kMostTasks : TourTable::kMostUncertainTasks;
                if (n > static_cast<std::size_t>(most)) {
                    refuse("weight must name at most " + std::to_string(most) + " tasks");
                }
                nb::gil_scoped_release released;
                Watch never;
                new (self) TourTable(static_cast<int>(n), weight.data(), survival.data(),
                                     leg_s.data(), horizon_s, never);
            },
            nb::arg("weight").noconvert(), nb::arg("survival").noconvert(), nb::arg("leg_s").noconvert(), nb::arg("horizon_s"))
        .def("first_values",
             [](const TourTable& self, std::uint32_t mask, In<double, 1> completion_s) {
                 const std::size_t n = static_cast<std::size_t>(self.size());
                 require_shape("completion_s", completion_s, {n});
                 if (mask >> n) refuse("mask must have bits of positions only");
                 std::vector<double> values(n);
                 self.first_values(mask, completion_s.data(), values.data());
                 return give(std::move(values));
             },
             nb::arg("mask"), nb::arg("completion_s").noconvert())
        .def("values",
             [](const TourTable& self, In<double, 1> completion_s) {
                 const std::size_t n = static_cast<std::size_t>(self.size());
                 require_shape("completion_s", completion_s, {n});
                 std::vector<double> best(std::size_t{1} << n);
                 {
                     nb::gil_scoped_release released;
                     Watch never;
                     self.values(completion_s.data(), best.data(), never);
                 }
                 return give(std::move(best));
             },
             nb::arg("completion_s").noconvert())
        .def("best_tour",
             [](const TourTable& self, std::uint32_t mask, In<double, 1> completion_s) {
                 const std::size_t n = static_cast<std::size_t>(self.size());
                 require_shape("completion_s", completion_s, {n});
                 if (mask >> n) refuse("mask must have bits of positions only");
                 const std::vector<int> tour = self.best_tour(mask, completion_s.data());
                 return give(std::vector<std::int64_t>(tour.begin(), tour.end()));
             },
             nb::arg("mask"), nb::arg("completion_s").noconvert());
}

}  // namespace peckorder
