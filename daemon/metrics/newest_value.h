// The newest value that one thread has put, for another that takes it. Neither waits for the other
// and there is no lock: a value that was not taken before the next one came is gone.
#pragma once

#include <atomic>
#include <memory>

namespace focalfleet {

template <class T>
class NewestValue {
 public:
  NewestValue() = default;
  NewestValue(const NewestValue&) = delete;
  NewestValue& operator=(const NewestValue&) = delete;
  ~NewestValue() { Take(); }

  void Put(std::unique_ptr<T> value) {
    delete slot_.exchange(value.release(), std::memory_order_acq_rel);
  }
  /// Null: nothing came since the last call.
  std::unique_ptr<T> Take() {
    return std::unique_ptr<T>(slot_.exchange(nullptr, std::memory_order_acq_rel));
  }

 private:
  std::atomic<T*> slot_{nullptr};
};

}  // namespace focalfleet
