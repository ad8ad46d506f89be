#include "routes_pricing.hpp"

#include <atomic>

#include "parallel.hpp"
#include "routes_heads.hpp"
#include "routes_offer.hpp"
#include "routes_tails.hpp"

namespace peckorder {

namespace {

PricedList price_list(const Problem& problem, const Start& start, int uav,
                      const ListPricing& pricing, Watch& watch) {
  const Offer offer(problem, start, uav, pricing, watch);
  if (offer.n() == 0 || watch.stopped()) return {};
  const Tails tails(offer, watch);
  if (watch.stopped()) return {};
  PricedList found;
  if (tails.overflown()) {
    for (int i = 0; i < offer.n(); ++i) found.bound += offer.gain(i, offer.first_s[i]);
  } else {
    found = Heads(offer, tails).search(pricing.heads, watch);
  }
  found.bound += offer.beside;
  return found;
}

WorthyLists worthy_list(const Problem& problem, const Start& start, int uav,
                        const ListPricing& pricing, double floor, Watch& watch) {
  const Offer offer(problem, start, uav, pricing, watch);
  if (offer.n() == 0 || watch.stopped()) return {};
  const Tails tails(offer, watch);
  WorthyLists found;
  if (!tails.overflown() && !watch.stopped())
    found = lists_from(offer, tails, floor, pricing.heads, watch);
  found.all = found.all && !tails.overflown() && offer.beside == 0.0;
  return found;
}

// work(uav) for each active UAV, in any order.
template <typename Work>
void for_active(const Start& start, int threads, Watch& watch, const Work& work) {
  parallel_for(start.active.size(), threads, 1, [&] {
    return [&](std::size_t uav) {
      if (start.active[uav] && !watch.stopped()) work(static_cast<int>(uav));
    };
  });
}

}  // namespace

std::vector<PricedList> price_lists(const Problem& problem, const Start& start,
                                    const ListPricing& pricing, Watch& watch) {
  std::vector<PricedList> found(start.active.size());
  for_active(start, pricing.threads, watch, [&](int uav) {
    found[uav] = price_list(problem, start, uav, pricing, watch);
  });
  return found;
}

std::vector<WorthyLists> worthy_lists(const Problem& problem, const Start& start,
                                      const ListPricing& pricing,
                                      const std::vector<double>& most, Watch& watch) {
  std::vector<WorthyLists> found(start.active.size());
  std::atomic<bool> missing{false};  // then all is in vain
  for_active(start, pricing.threads, watch, [&](int uav) {
    if (!missing)
      found[uav] =
          worthy_list(problem, start, uav, pricing, most[uav] - pricing.slack, watch);
    if (missing || !found[uav].all) {
      found[uav] = {false, {}, {}};
      missing = true;
    }
  });
  return found;
}

}  // namespace peckorder
