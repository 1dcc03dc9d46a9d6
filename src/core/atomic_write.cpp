// SPDX-License-Identifier: Apache-2.0
#include "core/atomic_write.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <string>
#include <system_error>
#include <utility>

#include "core/error.h"

namespace virga {
namespace fs = std::filesystem;
namespace {

std::string remedy(int code, const fs::path& folder) {
  switch (code) {
    case ENOENT:
      return fmt::format("the folder \"{}\" does not exist: create it or choose another", folder.string());
    case ENOTDIR:
      return fmt::format("\"{}\" is not a folder: choose another", folder.string());
    case EISDIR:
      return "it is a folder: give the name of a file";
    case EACCES:
    case EPERM:
      return fmt::format("no permission to write in \"{}\": choose another folder", folder.string());
    case EROFS:
      return fmt::format("\"{}\" is read-only: choose another folder", folder.string());
    case ENOSPC:
    case EDQUOT:
      return "the disk is full: free some space or choose another folder";
    case EFBIG:
      return "the file is larger than this system allows: choose another folder or write less";
    case ENAMETOOLONG:
      return "the name is too long: choose a shorter one";
    default:
      return std::strerror(code);
  }
}

[[noreturn]] void refuse(const fs::path& path, int code) {
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  throw Error(fmt::format("cannot write \"{}\"", path.string()),
              {.position = {}, .hint = remedy(code, folder), .notes = {}});
}

// An open file that closes itself. Errors name `shown`, the file that the user asked for.
class OutputFile {
 public:
  OutputFile(const fs::path& path, int flags, fs::path shown) : shown_(std::move(shown)) {
    descriptor_ = ::open(path.c_str(), O_WRONLY | O_CLOEXEC | flags, 0666);
    if (descriptor_ < 0) refuse(shown_, errno);
  }
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }

  void write(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
      if (written < 0 && errno != EINTR) refuse(shown_, errno);
      if (written > 0) bytes.remove_prefix(static_cast<size_t>(written));
    }
  }
  void sync() {
    if (::fsync(descriptor_) != 0 && errno != EINVAL) refuse(shown_, errno);
  }
  void close() {
    if (::close(std::exchange(descriptor_, -1)) != 0) refuse(shown_, errno);
  }

 private:
  fs::path shown_;
  int descriptor_ = -1;
};

// A new file in the folder of `target`; goes away unless it takes the target's name.
class TemporaryFile {
 public:
  explicit TemporaryFile(const fs::path& target)
      : target_(target), path_(freshName(target)), file_(path_, O_CREAT | O_EXCL, target) {}
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() {
    if (!path_.empty()) ::unlink(path_.c_str());
  }

  void write(std::string_view bytes) { file_.write(bytes); }
  // Syncs first: after a power cut the name must not stand for a file whose blocks never reached the disk.
  void takeName() {
    file_.sync();
    file_.close();
    if (::rename(path_.c_str(), target_.c_str()) != 0) refuse(target_, errno);
    path_.clear();
  }

 private:
  static fs::path freshName(const fs::path& target) {
    static std::atomic<unsigned> counter{0};
    return target.parent_path() / fmt::format(".virga-{}-{}.tmp", ::getpid(), counter++);
  }

  fs::path target_, path_;
  OutputFile file_;
};

// Where the bytes end up: the target of a symbolic link, which may be missing itself.
fs::path followed(const fs::path& path) {
  std::error_code ignored;
  const fs::path resolved = fs::is_symlink(path, ignored) ? fs::weakly_canonical(path, ignored) : path;
  return resolved.empty() ? path : resolved;
}

bool isDeviceOrPipe(const fs::path& path) {
  std::error_code ignored;
  return fs::is_character_file(path, ignored) || fs::is_fifo(path, ignored) || fs::is_block_file(path, ignored);
}

// What a temporary file beside the target would not show.
void checkName(const fs::path& path) {
  std::error_code failure;
  const fs::file_status status = fs::status(path, failure);
  if (!path.has_filename() || fs::is_directory(status)) refuse(path, EISDIR);
  if (failure == std::errc::filename_too_long) refuse(path, ENAMETOOLONG);
}

}  // namespace

void writeAtomically(const fs::path& path, std::string_view bytes) {
  const fs::path target = followed(path);
  checkName(target);
  if (isDeviceOrPipe(target)) return OutputFile(target, 0, path).write(bytes);
  TemporaryFile file(target);
  file.write(bytes);
  file.takeName();
}

void checkWritable(const fs::path& path) {
  const fs::path target = followed(path);
  checkName(target);
  if (isDeviceOrPipe(target)) {
    if (::access(target.c_str(), W_OK) != 0) refuse(target, errno);
    return;
  }
  TemporaryFile(target).write("x");
}

}  // namespace virga
