// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <signal.h>

#include <atomic>
#include <functional>
#include <mutex>
#include <stop_token>
#include <thread>

namespace virga::app {

/// While it lives, the first SIGINT or SIGTERM asks for a stop and calls `onRequest`; a second one ends the process at
/// once (exit code 130) and leaves no files. Make it before any other thread is started: they inherit its signal mask.
class Interrupt {
 public:
  explicit Interrupt(std::function<void()> onRequest);
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  ~Interrupt();

  bool requested() const { return stop_.stop_requested(); }
  std::stop_token token() const { return stop_.get_token(); }
  /// As long as the lock is held, a second signal waits: for writing files.
  std::unique_lock<std::mutex> shield() { return std::unique_lock(writing_); }

 private:
  void listen();

  std::function<void()> onRequest_;
  std::stop_source stop_;
  std::mutex writing_;
  std::atomic<bool> done_ = false;
  sigset_t signals_{}, maskBefore_{};
  std::thread listener_;
};

}  // namespace virga::app
