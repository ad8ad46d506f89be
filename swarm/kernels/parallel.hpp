// Independent jobs over a few threads. Who runs a job must not matter to its result.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <thread>
#include <vector>

namespace peckorder {

// Calls work(job) for jobs 0..count-1, in blocks that idle threads fetch; rethrows what a job threw.
// Every thread first calls prepare() for a worker of its own, a callable taking the job.
template <typename Prepare>
void parallel_for(std::size_t count, int threads, std::size_t block, const Prepare& prepare) {
    block = std::max<std::size_t>(1, block);
    const std::size_t blocks = (count + block - 1) / block;
    const std::size_t used =
        std::min<std::size_t>(static_cast<std::size_t>(std::max(1, threads)), blocks);
    std::atomic<std::size_t> next{0};
    std::vector<std::exception_ptr> failures(used);
    auto run = [&](std::size_t self) {
        try {
            auto work = prepare();
            for (std::size_t b = next++; b < blocks; b = next++) {
                const std::size_t end = std::min(count, (b + 1) * block);
                for (std::size_t job = b * block; job < end; ++job) work(job);
            }
        } catch (...) {
            failures[self] = std::current_exception();
            next = blocks;
        }
    };
    std::vector<std::thread> others;
    others.reserve(used);
    for (std::size_t self = 1; self < used; ++self) {
        try {
            others.emplace_back(run, self);
        } catch (...) {
            break;  // the system has no thread left for us: fewer do the same work
        }
    }
    if (used > 0) run(0);
    for (std::thread& other : others) other.join();
    for (const std::exception_ptr& failure : failures) {
        if (failure) std::rethrow_exception(failure);
    }
}

}  // namespace peckorder
