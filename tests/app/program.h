// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace virga::app {

/// What a run of the program left behind.
struct Ended {
  int exitCode = -1;  ///< 128 + the signal that ended it, if one did
  std::string out, err;
};

/// A folder of its own for one test; gone with it.
class Scratch {
 public:
  Scratch();
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  ~Scratch();

  std::filesystem::path path(const std::string& name) const { return folder_ / name; }
  void write(const std::string& name, const std::string& text) const;
  std::string read(const std::string& name) const;
  /// Names of the files in it, sorted.
  std::vector<std::string> files() const;

 private:
  std::filesystem::path folder_;
};

/// The built virga, running in the scratch folder.
class Program {
 public:
  Program(const Scratch&, const std::vector<std::string>& arguments);
  void signal(int number) const;
  /// Waits until the text stands on stderr, or the program has ended, or 60 s are over. True if it stands there.
  bool waitForStderr(const std::string& text) const;
  Ended wait();

 private:
  std::filesystem::path out_, err_;
  pid_t pid_ = -1;
};

Ended virga(const Scratch&, const std::vector<std::string>& arguments);

}  // namespace virga::app
