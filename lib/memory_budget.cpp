#include "lib/memory_budget.hpp"

#include <algorithm>
#include <utility>

#include "lib/error.hpp"

namespace wedgescope {

MemoryBudget::Token::Token(Token&& other) noexcept
    : budget_(std::exchange(other.budget_, nullptr)), bytes_(std::exchange(other.bytes_, 0)) {}

MemoryBudget::Token& MemoryBudget::Token::operator=(Token&& other) noexcept {
    if (this != &other) {
        if (budget_) budget_->give(bytes_);
        budget_ = std::exchange(other.budget_, nullptr);
        bytes_ = std::exchange(other.bytes_, 0);
    }
    return *this;
}

MemoryBudget::Token::~Token() {
    if (budget_) budget_->give(bytes_);
}

MemoryBudget::Token MemoryBudget::take(std::size_t bytes) {
    if (bytes > total_)
        throw IoError(text("a stage needs ", bytes, " bytes of memory at once; the budget is ", total_, " bytes"));
    std::unique_lock lock(mutex_);
    returned_.wait(lock, [&] { return stopped_ || bytes <= total_ - held_; });
    if (stopped_) return {};
    held_ += bytes;
    peak_ = std::max(peak_, held_);
    return Token(this, bytes);
}

MemoryBudget::Token MemoryBudget::try_take(std::size_t bytes) {
    const std::lock_guard lock(mutex_);
    if (stopped_ || bytes > total_ - held_) return {};
    held_ += bytes;
    peak_ = std::max(peak_, held_);
    return Token(this, bytes);
}

void MemoryBudget::stop() {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    returned_.notify_all();
}

std::size_t MemoryBudget::held() const {
    const std::lock_guard lock(mutex_);
    return held_;
}

std::size_t MemoryBudget::peak() const {
    const std::lock_guard lock(mutex_);
    return peak_;
}

void MemoryBudget::give(std::size_t bytes) noexcept {
    // Woken under the lock: a waiter may then end the budget's life only after this thread has let go of it.
    const std::lock_guard lock(mutex_);
    held_ -= bytes;
    returned_.notify_all();
}

}  // namespace wedgescope
