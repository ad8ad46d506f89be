// How fast the lower level could be: the sweeps of greedy decisions over the open tasks, by hand.
//
// The same columns of doubles and the same arithmetic as the kernel, square root and division
// included, since those decide the pace; two tasks in a register and two registers at a time, the
// best score and its place kept in registers, nothing stored but what is taken. No queue of UAVs, no
// certificate, no rules, no checks: UAVs take turns. Prints nanoseconds of processor time per task
// looked at.
//
// Usage: sweep_limit UAVS TASKS SEQUENCES
#include <emmintrin.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <limits>
#include <vector>

namespace {

struct Columns {
    std::vector<double> x, y, z, service;
    std::vector<std::int32_t> task;
    std::size_t n = 0;

    void remove(std::size_t at) {
        --n;
        auto close = [&](auto& column) {
            std::memmove(&column[at], &column[at + 1], (n - at) * sizeof(column[0]));
        };
        close(x), close(y), close(z), close(service), close(task);
    }
};

struct Uav {
    double x, y, z, speed, free, survived;
    const double* weight;
};

std::size_t sweep(const Columns& c, const Uav& u, double horizon, double& completion) {
    const __m128d ux = _mm_set1_pd(u.x), uy = _mm_set1_pd(u.y), uz = _mm_set1_pd(u.z);
    const __m128d speed = _mm_set1_pd(u.speed), free = _mm_set1_pd(u.free);
    const __m128d survived = _mm_set1_pd(u.survived), end = _mm_set1_pd(horizon);
    const double least = -std::numeric_limits<double>::infinity();
    __m128d best[2] = {_mm_set1_pd(least), _mm_set1_pd(least)};
    __m128d place[2] = {_mm_setzero_pd(), _mm_setzero_pd()};
    auto scores = [&](std::size_t i) {
        const __m128d dx = _mm_sub_pd(_mm_loadu_pd(&c.x[i]), ux);
        const __m128d dy = _mm_sub_pd(_mm_loadu_pd(&c.y[i]), uy);
        const __m128d dz = _mm_sub_pd(_mm_loadu_pd(&c.z[i]), uz);
        const __m128d square = _mm_add_pd(_mm_add_pd(_mm_mul_pd(dx, dx), _mm_mul_pd(dy, dy)),
                                          _mm_mul_pd(dz, dz));
        const __m128d travel = _mm_div_pd(_mm_sqrt_pd(square), speed);
        const __m128d time = _mm_add_pd(_mm_add_pd(free, travel), _mm_loadu_pd(&c.service[i]));
        const __m128d weight = _mm_set_pd(u.weight[c.task[i + 1]], u.weight[c.task[i]]);
        return _mm_mul_pd(_mm_sub_pd(end, time), _mm_mul_pd(survived, weight));
    };
    std::size_t i = 0;
    for (; i + 4 <= c.n; i += 4) {
        for (std::size_t k = 0; k < 2; ++k) {
            const __m128d score = scores(i + 2 * k);
            const __m128d at = _mm_set1_pd(static_cast<double>(i + 2 * k));
            const __m128d more = _mm_cmpgt_pd(score, best[k]);
            best[k] = _mm_max_pd(score, best[k]);
            place[k] = _mm_or_pd(_mm_and_pd(more, at), _mm_andnot_pd(more, place[k]));
        }
    }
    double top = least;
    std::size_t winner = 0;
    for (std::size_t k = 0; k < 2; ++k) {
        double value[2], where[2];
        _mm_storeu_pd(value, best[k]);
        _mm_storeu_pd(where, place[k]);
        for (std::size_t lane = 0; lane < 2; ++lane) {
            const std::size_t at = static_cast<std::size_t>(where[lane]) + lane;
            if (value[lane] > top || (value[lane] == top && at < winner)) {
                top = value[lane];
                winner = at;
            }
        }
    }
    auto time_of = [&](std::size_t at) {
        const double dx = c.x[at] - u.x, dy = c.y[at] - u.y, dz = c.z[at] - u.z;
        return (u.free + __builtin_sqrt((dx * dx + dy * dy) + dz * dz) / u.speed) + c.service[at];
    };
    for (; i < c.n; ++i) {
        const double score = (horizon - time_of(i)) * (u.survived * u.weight[c.task[i]]);
        if (score > top) {
            top = score;
            winner = i;
        }
    }
    completion = time_of(winner);
    return winner;
}

double uniform() { return std::rand() / (RAND_MAX + 1.0); }

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4) return 2;
    const std::size_t n_uav = std::strtoul(argv[1], nullptr, 10);
    const std::size_t n_task = std::strtoul(argv[2], nullptr, 10);
    const std::size_t sequences = std::strtoul(argv[3], nullptr, 10);
    Columns all;
    all.n = n_task;
    for (std::size_t i = 0; i < n_task; ++i) {
        all.x.push_back(1000.0 * uniform());
        all.y.push_back(1000.0 * uniform());
        all.z.push_back(10.0 * uniform());
        all.service.push_back(10.0 * uniform());
        all.task.push_back(static_cast<std::int32_t>(i));
    }
    std::vector<double> weight(n_uav * n_task);
    for (double& w : weight) w = uniform();
    double checksum = 0.0, best_ns = 1e300;
    for (int repeat = 0; repeat < 5; ++repeat) {
        std::uint64_t looks = 0;
        const std::clock_t begin = std::clock();
        for (std::size_t s = 0; s < sequences; ++s) {
            Columns open = all;
            std::vector<Uav> fleet;
            for (std::size_t u = 0; u < n_uav; ++u) {
                fleet.push_back({500.0, 500.0, 0.0, 10.0, 0.0, 1.0, &weight[u * n_task]});
            }
            for (std::size_t d = 0; open.n; ++d) {
                Uav& uav = fleet[d % n_uav];
                looks += open.n;
                const std::size_t at = sweep(open, uav, 1e4, uav.free);
                uav.x = open.x[at], uav.y = open.y[at], uav.z = open.z[at];
                checksum += uav.free;
                open.remove(at);
            }
        }
        const double took_ns = 1e9 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
        best_ns = std::min(best_ns, took_ns / static_cast<double>(looks));
    }
    std::fprintf(stderr, "checksum %.17g\n", checksum);
    std::printf("%.6f\n", best_ns);
    return 0;
}
