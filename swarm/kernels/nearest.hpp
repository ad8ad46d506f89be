// Which places are nearest to each of many.
#pragma once

#include <cstdint>
#include <vector>

namespace peckorder {

// Of n places (n, 3): for each the `count` < n others that are nearest to it, nearest first, of
// equal ones the smaller index. Takes time in n · count where places are spread evenly, in n² where
// most of them share few spots.
std::vector<std::int32_t> nearest(const double* place_m, int n, int count);

}  // namespace peckorder
