// MemoryBudget: bytes granted by the user, taken and given back as tokens; who waits is woken by a return or by stop.
// Leaves how much a stage needs to the stage.
#pragma once
#include <condition_variable>
#include <cstddef>
#include <mutex>

namespace wedgescope {

class MemoryBudget {
public:
    explicit MemoryBudget(std::size_t bytes) : total_(bytes) {}

    /// Bytes held until destroyed. Movable; an empty token holds nothing.
    class Token {
    public:
        Token() = default;
        Token(Token&& other) noexcept;
        Token& operator=(Token&& other) noexcept;
        ~Token();
        std::size_t bytes() const { return bytes_; }

    private:
        friend class MemoryBudget;
        Token(MemoryBudget* budget, std::size_t bytes) : budget_(budget), bytes_(bytes) {}
        MemoryBudget* budget_ = nullptr;
        std::size_t bytes_ = 0;
    };

    /// Waits until `bytes` are free; an empty token after stop(). IoError at once if they never can be.
    Token take(std::size_t bytes);
    /// Does not wait: an empty token (of 0 bytes) if they are not free now.
    Token try_take(std::size_t bytes);
    /// Wakes every waiter; from then on take() returns empty tokens.
    void stop();

    std::size_t total() const { return total_; }
    std::size_t held() const;
    std::size_t peak() const;  ///< most held at a time

private:
    void give(std::size_t bytes) noexcept;

    const std::size_t total_;
    mutable std::mutex mutex_;
    std::condition_variable returned_;
    std::size_t held_ = 0;
    std::size_t peak_ = 0;
    bool stopped_ = false;
};

}  // namespace wedgescope
