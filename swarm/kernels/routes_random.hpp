// A small pseudo-random generator whose numbers are the same on every machine.
//
// xoshiro256** seeded by splitmix64 (Blackman and Vigna 2021, doi:10.1145/3460772), and an
// exponential variate from additions and multiplications alone, since std::log may differ
// between mathematics libraries in the last bit.
#pragma once

#include <cstdint>
#include <cstring>

namespace peckorder {

class Random {
 public:
  explicit Random(std::uint64_t seed) {
    for (std::uint64_t& word : state_) {
      seed += 0x9E3779B97F4A7C15ull;
      std::uint64_t z = seed;
      z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
      z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
      word = z ^ (z >> 31);
    }
  }

  std::uint64_t bits() {
    const std::uint64_t result = rotate(state_[1] * 5, 7) * 9;
    const std::uint64_t shifted = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= shifted;
    state_[3] = rotate(state_[3], 45);
    return result;
  }

  // Uniform in [0, 1).
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1.0p-53; }

  // Uniform in 0..n-1; n > 0. The bias of 2^-32 · n does not matter to a heuristic.
  int below(int n) {
    return static_cast<int>(((bits() >> 32) * static_cast<std::uint64_t>(n)) >> 32);
  }

  // Exponential variate of mean 1.
  double exponential() {
    return -natural_logarithm(static_cast<double>((bits() >> 11) + 1) * 0x1.0p-53);
  }

 private:
  static std::uint64_t rotate(std::uint64_t x, int by) { return (x << by) | (x >> (64 - by)); }

  // ln x for normal x > 0, to about 1e-7: exponent · ln 2 + 2 artanh((m-1)/(m+1)).
  static double natural_logarithm(double x) {
    std::uint64_t word;
    std::memcpy(&word, &x, sizeof word);
    const int exponent = static_cast<int>(word >> 52) - 1023;
    word = (word & 0x000FFFFFFFFFFFFFull) | 0x3FF0000000000000ull;
    double mantissa;
    std::memcpy(&mantissa, &word, sizeof mantissa);
    const double z = (mantissa - 1.0) / (mantissa + 1.0);
    const double q = z * z;
    const double series =
        1.0 + q * (1.0 / 3 + q * (1.0 / 5 + q * (1.0 / 7 + q * (1.0 / 9 + q * (1.0 / 11)))));
    return static_cast<double>(exponent) * 0.69314718055994530942 + 2.0 * z * series;
  }

  std::uint64_t state_[4];
};

}  // namespace peckorder
