// SPDX-License-Identifier: Apache-2.0
#include "app/program.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <thread>

namespace virga::app {
namespace {

std::string contents(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

[[noreturn]] void become(const std::filesystem::path& folder, const std::filesystem::path& out,
                         const std::filesystem::path& err, std::vector<char*> arguments) {
  const int outFile = ::open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  const int errFile = ::open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  ::dup2(outFile, STDOUT_FILENO);
  ::dup2(errFile, STDERR_FILENO);
  ::signal(SIGINT, SIG_DFL);  // whoever started the tests may have ignored it
  if (::chdir(folder.c_str()) == 0) ::execv(VIRGA_BINARY, arguments.data());
  ::_exit(127);
}

}  // namespace

Scratch::Scratch() {
  static std::atomic<int> counter{0};
  folder_ = std::filesystem::temp_directory_path() / fmt::format("virga-test-{}-{}", ::getpid(), counter++);
  std::filesystem::create_directories(folder_);
}

Scratch::~Scratch() {
  std::error_code ignored;
  std::filesystem::permissions(folder_, std::filesystem::perms::owner_all, ignored);
  std::filesystem::remove_all(folder_, ignored);
}

void Scratch::write(const std::string& name, const std::string& text) const {
  std::ofstream(path(name), std::ios::binary) << text;
}

std::string Scratch::read(const std::string& name) const { return contents(path(name)); }

std::vector<std::string> Scratch::files() const {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) names.push_back(entry.path().filename());
  std::sort(names.begin(), names.end());
  return names;
}

Program::Program(const Scratch& scratch, const std::vector<std::string>& arguments) {
  // Beside the folder, not in it: what the program leaves in it is looked at.
  static std::atomic<int> counter{0};
  const std::string stem = fmt::format("{}.{}", scratch.path("").parent_path().string(), counter++);
  out_ = stem + ".out", err_ = stem + ".err";
  std::vector<std::string> words{VIRGA_BINARY};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& w : words) pointers.push_back(w.data());
  pointers.push_back(nullptr);
  pid_ = ::fork();
  if (pid_ == 0) become(scratch.path(""), out_, err_, std::move(pointers));
  if (pid_ < 0) throw std::runtime_error("cannot fork");
}

void Program::signal(int number) const { ::kill(pid_, number); }

bool Program::waitForStderr(const std::string& text) const {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (std::chrono::steady_clock::now() < end) {
    if (contents(err_).find(text) != std::string::npos) return true;
    siginfo_t info{};
    if (::waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 && info.si_pid != 0)
      return contents(err_).find(text) != std::string::npos;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return false;
}

Ended Program::wait() {
  int status = 0;
  ::waitpid(pid_, &status, 0);
  Ended run;
  run.exitCode = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  run.out = contents(out_);
  run.err = contents(err_);
  std::error_code ignored;
  std::filesystem::remove(out_, ignored);
  std::filesystem::remove(err_, ignored);
  return run;
}

Ended virga(const Scratch& scratch, const std::vector<std::string>& arguments) {
  return Program(scratch, arguments).wait();
}

}  // namespace virga::app
