// What crosses the border to Python: arrays in and out, and refusals that name the argument.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace peckorder {

namespace nb = nanobind;

template <typename T, std::size_t N>
using In = nb::ndarray<const T, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
template <typename T, std::size_t N>
using Out = nb::ndarray<nb::numpy, T, nb::ndim<N>>;

[[noreturn]] inline void refuse(const std::string& what) { throw nb::value_error(what.c_str()); }

template <typename T, std::size_t N>
void require_shape(const char* name, const In<T, N>& array, const std::size_t (&shape)[N]) {
    bool same = true;
    std::string wanted, found;
    for (std::size_t axis = 0; axis < N; ++axis) {
        same = same && array.shape(axis) == shape[axis];
        wanted += (axis ? ", " : "") + std::to_string(shape[axis]);
        found += (axis ? ", " : "") + std::to_string(array.shape(axis));
    }
    if (!same) {
        const char* tail = N == 1 ? ",)" : ")";
        refuse(std::string(name) + " must have shape (" + wanted + tail + ", not (" + found + tail);
    }
}

inline void require_finite(const char* name, const double* first, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
        if (!std::isfinite(first[i])) {
            refuse(std::string(name) + " must be finite, not NaN or infinite");
        }
    }
}

inline void require_within(const char* name, double value, double low, double high,
                           const char* range) {
    if (!(value >= low && value <= high)) {
        refuse(std::string(name) + " must be " + range + ", not " + std::to_string(value));
    }
}

// NumPy's booleans arrive as bytes: a view may hold others than 0 and 1, which C++ must not see.
inline const std::uint8_t* bytes_of(const In<bool, 1>& array) {
    return reinterpret_cast<const std::uint8_t*>(array.data());
}

template <typename T, std::size_t N>
Out<T, N> give(std::vector<T>&& values, const std::size_t (&shape)[N]) {
    auto* kept = new std::vector<T>(std::move(values));
    nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    return Out<T, N>(kept->data(), N, shape, owner);
}

template <typename T>
Out<T, 1> give(std::vector<T>&& values) {
    const std::size_t shape[1] = {values.size()};
    return give<T, 1>(std::move(values), shape);
}

}  // namespace peckorder
