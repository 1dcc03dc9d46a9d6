// SPDX-License-Identifier: Apache-2.0
#include "core/atomic_write.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>

#include "image/image_io.h"
#include "scratch.h"

namespace virga {
namespace {

// While it lives, no file of this process can grow beyond `bytes`: a disk that is full in the middle of a file.
class FullDisk {
 public:
  explicit FullDisk(rlim_t bytes) {
    handler_ = std::signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;
  ~FullDisk() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  rlimit before_;
  void (*handler_)(int);
};

TEST(AtomicWrite, ReplacesAFile) {
  const ScratchFolder folder;
  writeAtomically(folder / "a", "first, which is longer");
  writeAtomically(folder / "a", "second");
  EXPECT_EQ(fileBytes(folder / "a"), "second");
  EXPECT_EQ(folder.files(), 1u);
}

TEST(AtomicWrite, FailureInTheMiddleKeepsTheOldFile) {
  const ScratchFolder folder;
  putBytes(folder / "a.exr", "precious");
  putBytes(folder / "a.png", "precious");
  std::string message;
  {
    const FullDisk full(100);
    message = errorOf([&] { writeAtomically(folder / "a.exr", std::string(1000, 'x')); });
    errorOf([&] { writeExr(folder / "a.exr", Image(64, 64, Rgb(1))); });
    errorOf([&] { writePng(folder / "a.png", Image(64, 64, Rgb(1))); });
    errorOf([&] { writeAtomically(folder / "new.exr", std::string(1000, 'x')); });
  }
  EXPECT_NE(message.find("a.exr"), std::string::npos) << message;
  EXPECT_NE(message.find("larger than this system allows"), std::string::npos) << message;
  EXPECT_EQ(fileBytes(folder / "a.exr"), "precious");
  EXPECT_EQ(fileBytes(folder / "a.png"), "precious");
  EXPECT_EQ(folder.files(), 2u) << "temporary files were left";
}

TEST(AtomicWrite, UnwritablePlacesAreErrorsWithARemedy) {
  const ScratchFolder folder;
  putBytes(folder / "file", "x");
  std::filesystem::create_directory(folder / "directory");
  struct Place {
    std::filesystem::path path;
    std::string remedy;
  };
  for (const Place& place :
       {Place{folder / "no/such/a.exr", "does not exist: create it"}, Place{folder / "file/a.exr", "is not a folder"},
        Place{folder / "directory", "give the name of a file"}, Place{folder / "directory/", "give the name of a file"},
        Place{folder / std::string(300, 'a'), "choose a shorter one"}}) {
    const std::string written = errorOf([&] { writeExr(place.path, Image(1, 1)); });
    const std::string checked = errorOf([&] { checkWritable(place.path); });
    EXPECT_NE(written.find(place.remedy), std::string::npos) << written;
    EXPECT_NE(written.find(place.path.string()), std::string::npos) << written;
    EXPECT_EQ(checked, written);
  }
}

TEST(AtomicWrite, FolderWithoutPermissionIsAnError) {
  const ScratchFolder folder;
  constexpr uid_t kNobody = 65534;  // root may write everywhere
  const bool root = ::geteuid() == 0;
  std::filesystem::create_directory(folder / "closed");
  std::filesystem::permissions(folder / "closed",
                               std::filesystem::perms::owner_read | std::filesystem::perms::owner_exec);
  ASSERT_EQ(::seteuid(root ? kNobody : ::geteuid()), 0);
  const std::string message = errorOf([&] { checkWritable(folder / "closed/a.exr"); });
  ASSERT_EQ(::seteuid(root ? 0 : ::geteuid()), 0);
  EXPECT_NE(message.find("no permission to write"), std::string::npos) << message;
}

TEST(AtomicWrite, CheckLeavesNoTrace) {
  const ScratchFolder folder;
  putBytes(folder / "a", "old");
  checkWritable(folder / "a");
  checkWritable(folder / "b");
  checkWritable("/dev/null");
  EXPECT_EQ(fileBytes(folder / "a"), "old");
  EXPECT_EQ(folder.files(), 1u);
}

TEST(AtomicWrite, FollowsLinksAndLeavesDevicesAlone) {
  const ScratchFolder folder;
  std::filesystem::create_directory(folder / "far");
  putBytes(folder / "far/a", "old");
  std::filesystem::create_symlink("far/a", folder / "link");
  writeAtomically(folder / "link", "new");
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link"));
  EXPECT_EQ(fileBytes(folder / "far/a"), "new");
  writeAtomically("/dev/null", "gone");
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
}

TEST(AtomicWrite, WorksInTheCurrentFolder) {
  const ScratchFolder folder;
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder.path());
  EXPECT_NO_THROW(writeAtomically("a", "here"));
  std::filesystem::current_path(before);
  EXPECT_EQ(fileBytes(folder / "a"), "here");
}

}  // namespace
}  // namespace virga
