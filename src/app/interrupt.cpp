// SPDX-License-Identifier: Apache-2.0
#include "app/interrupt.h"

#include <unistd.h>

#include <utility>

namespace virga::app {
namespace {

constexpr int kExitInterrupted = 130;  // 128 + SIGINT, as shells report it

// A signal that the parent asked to ignore (nohup, a background job of a script) stays ignored.
bool isIgnored(int signal) {
  struct sigaction action {};
  return ::sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

}  // namespace

Interrupt::Interrupt(std::function<void()> onRequest) : onRequest_(std::move(onRequest)) {
  ::sigemptyset(&signals_);
  for (const int signal : {SIGINT, SIGTERM})
    if (!isIgnored(signal)) ::sigaddset(&signals_, signal);
  sigset_t blocked = signals_;
  ::sigaddset(&blocked, SIGUSR1);  // wakes the listener at the end
  ::pthread_sigmask(SIG_BLOCK, &blocked, &maskBefore_);
  listener_ = std::thread([this] { listen(); });
}

Interrupt::~Interrupt() {
  done_ = true;
  ::pthread_kill(listener_.native_handle(), SIGUSR1);
  listener_.join();
  ::pthread_sigmask(SIG_SETMASK, &maskBefore_, nullptr);
}

void Interrupt::listen() {
  sigset_t awaited = signals_;
  ::sigaddset(&awaited, SIGUSR1);
  while (true) {
    int signal = 0;
    if (::sigwait(&awaited, &signal) != 0) continue;
    if (done_) return;
    if (signal == SIGUSR1) continue;
    if (stop_.request_stop()) {
      onRequest_();
    } else {
      const auto afterWriting = shield();
      ::_exit(kExitInterrupted);
    }
  }
}

}  // namespace virga::app
