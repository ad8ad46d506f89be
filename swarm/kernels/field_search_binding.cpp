// Python face of the search for lists under the field's constraints; see field_search.hpp.
#include <nanobind/stl/pair.h>

#include <memory>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "field_binding.hpp"
#include "field_search.hpp"
#include "watch_binding.hpp"

namespace peckorder {

namespace {

// A search with the state it refers to.
class BoundFieldSearch {
  public:
    BoundFieldSearch(const BoundField& field, BoundFieldTeam team, const In<std::int32_t, 1>& items,
                     const In<std::int64_t, 1>& offsets, std::uint64_t seed)
        : arrays_(std::move(team)), team_(arrays_.checked(field.problem)) {
        ItemLists lists(static_cast<std::size_t>(field.problem.n_uav));
        require_shape("offsets", offsets, {lists.size() + 1});
        for (std::size_t uav = 0; uav < lists.size(); ++uav) {
            const std::int64_t from = offsets.data()[uav], to = offsets.data()[uav + 1];
            if (from < 0 || to < from || to > static_cast<std::int64_t>(items.size()))
                refuse("offsets must rise from 0 to the number of items");
            lists[uav].assign(items.data() + from, items.data() + to);
            for (const Item item : lists[uav]) {
                if (item < -field.problem.n_base || item >= 2 * field.problem.n_task)
                    refuse("lists name a task or base that does not exist");
            }
        }
        const nb::gil_scoped_release released;
        search_ = std::make_unique<FieldSearch>(field.problem, team_, lists, seed);
    }

    void round(long iterations, double heat, int threads, nb::handle should_stop) {
        PythonWatch(should_stop).released(
            [&](Watch& watch) { search_->round(iterations, heat, threads, watch); });
    }

    void gather() {
        const nb::gil_scoped_release released;
        search_->gather();
    }

    int n_lane() const { return search_->n_lane(); }
    std::int64_t work() const { return search_->work(); }
    std::pair<int, double> best_worth() const {
        return {search_->best_worth().left_out, search_->best_worth().value};
    }
    std::pair<Out<std::int32_t, 1>, Out<std::int64_t, 1>> best() const {
        std::vector<std::int32_t> items;
        std::vector<std::int64_t> offsets{0};
        for (const std::vector<Item>& list : search_->best()) {
            items.insert(items.end(), list.begin(), list.end());
            offsets.push_back(static_cast<std::int64_t>(items.size()));
        }
        return {give(std::move(items)), give(std::move(offsets))};
    }

  private:
    BoundFieldTeam arrays_;
    FieldTeam team_;
    std::unique_ptr<FieldSearch> search_;
};

}  // namespace

void bind_field_search(nb::module_& module) {
    nb::class_<BoundFieldSearch>(module, "FieldListSearch")
        .def(
            "__init__",
            [](BoundFieldSearch* self, const BoundField& problem, In<double, 1> free_s,
               In<double, 1> sortie_end_s, In<double, 2> first_s, In<double, 1> survived,
               In<bool, 1> active, In<bool, 1> open, In<std::int32_t, 1> landed_at,
               In<std::int64_t, 1> rank, In<double, 1> arrives_s, In<std::int32_t, 1> leaving,
               In<double, 1> leaves_s, In<std::int32_t, 1> items, In<std::int64_t, 1> offsets,
               std::uint64_t seed) {
                new (self) BoundFieldSearch(problem,
                                            {free_s, sortie_end_s, first_s, survived, active, open,
                                             landed_at, rank, arrives_s, leaving, leaves_s},
                                            items, offsets, seed);
            },
            nb::keep_alive<1, 2>(), nb::arg("problem"), nb::arg("free_s"), nb::arg("sortie_end_s"),
            nb::arg("first_s"), nb::arg("survived"), nb::arg("active"), nb::arg("open"),
            nb::arg("landed_at"), nb::arg("rank"), nb::arg("arrives_s"), nb::arg("leaving"),
            nb::arg("leaves_s"), nb::arg("items"), nb::arg("offsets"), nb::arg("seed"))
        .def("round", &BoundFieldSearch::round, nb::arg("iterations"), nb::arg("heat"),
             nb::arg("threads"), nb::arg("should_stop") = nb::none())
        .def("gather", &BoundFieldSearch::gather)
        .def("n_lane", &BoundFieldSearch::n_lane)
        .def("work", &BoundFieldSearch::work)
        .def("best_worth", &BoundFieldSearch::best_worth)
        .def("best", &BoundFieldSearch::best);
}

}  // namespace peckorder
