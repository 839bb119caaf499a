#include "daemon/journal/journal_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <vector>

#include "daemon/clock/wall_time.h"
#include "daemon/files/text_file.h"
#include "daemon/journal/fields.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet::journal {
namespace {

using test::ScratchFolder;
using ::testing::HasSubstr;

LifeRecord SomeLife(std::int64_t at_s = 1'700'000'000) {
  LifeRecord life;
  life.version = "1.2.3";
  life.at = {at_s * 1'000'000'000};
  life.units.resize(2);
  life.units[1].id = {7};
  life.units[1].rail_slot = 3;
  life.drives.resize(2);
  life.clearance_mm = 0.25;
  life.obstacles = {{.id = 5, .centre_fp = {1, 2}, .radius_mm = 3}};
  life.config.scatter_deg = 0.5;
  life.stored.next_configuration = 42;
  return life;
}

/// Records whose bytes hardly pack.
std::vector<NumberedRecord> Records(std::uint64_t first, std::uint64_t last,
                                    std::size_t size = 40) {
  std::vector<NumberedRecord> records;
  for (std::uint64_t step = first; step <= last; ++step) {
    std::string bytes(size, '\0');
    std::uint64_t word = step;
    for (char& byte : bytes)
      byte = static_cast<char>((word = word * 6364136223846793005u + 1442695040888963407u) >> 56);
    records.push_back({step, std::move(bytes)});
  }
  return records;
}

struct ReadBack {
  std::vector<std::string> records;
  std::string error;
  JournalReader::End end = JournalReader::End::kCutOff;
};

ReadBack ReadAllOf(const std::string& path) {
  ReadBack read;
  auto reader = JournalReader::Open(path);
  if (!reader) return {{}, reader.error().text, {}};
  for (;;) {
    const auto record = reader->Next();
    if (!record) read.error = record.error().text;
    if (!record || !*record) break;
    read.records.emplace_back(**record);
  }
  read.end = reader->end();
  return read;
}

class JournalFile : public ::testing::Test {
 protected:
  std::unique_ptr<JournalWriter> Writer(std::uint64_t limit_bytes = 1 << 30,
                                        const LifeRecord& life = SomeLife()) {
    auto writer = JournalWriter::Open({.folder = folder_, .limit_bytes = limit_bytes}, life);
    EXPECT_TRUE(writer) << writer.error().text;
    return writer ? std::move(*writer) : nullptr;
  }
  std::vector<std::string> Files() const {
    std::vector<std::string> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder_))
      files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    return files;
  }

  ScratchFolder scratch_;
  std::string folder_ = scratch_ / "journal";
};

TEST_F(JournalFile, GivesBackWhatWasWritten) {
  auto writer = Writer();
  ASSERT_TRUE(writer->Write(Records(1, 3)));
  ASSERT_TRUE(writer->Write(Records(4, 4)));
  ASSERT_TRUE(writer->End());
  const auto reader = JournalReader::Open(folder_);
  ASSERT_TRUE(reader) << reader.error().text;
  EXPECT_EQ(BytesOf(reader->life()), BytesOf(SomeLife()));
  EXPECT_EQ(reader->life().units[1].rail_slot, 3u);
  EXPECT_EQ(reader->life().config.scatter_deg, 0.5);
  const ReadBack read = ReadAllOf(Files().front());
  ASSERT_EQ(read.records.size(), 4u) << read.error;
  for (std::size_t n = 0; n < 4; ++n) EXPECT_EQ(read.records[n], Records(n + 1, n + 1)[0].bytes);
  EXPECT_EQ(read.end, JournalReader::End::kWhole);
}

TEST_F(JournalFile, TheNewestLifeOfAFolderIsRead) {
  ASSERT_TRUE(Writer(1 << 30, SomeLife(1'700'000'000))->Write(Records(1, 2)));
  ASSERT_TRUE(Writer(1 << 30, SomeLife(1'700'000'001))->Write(Records(1, 5)));
  EXPECT_EQ(ReadAllOf(folder_).records.size(), 5u);
  EXPECT_EQ(ReadAllOf(Files().front()).records.size(), 2u);
  EXPECT_EQ(ReadAllOf(folder_).end, JournalReader::End::kCutOff);
}

// The process may be killed at any byte, and the disk keeps what came before.
TEST_F(JournalFile, CutAnywhereItGivesTheWholeBlocksBefore) {
  auto writer = Writer();
  for (std::uint64_t step = 1; step <= 3; ++step) ASSERT_TRUE(writer->Write(Records(step, step)));
  const std::string path = Files().front();
  const std::string whole = *ReadFile(path);
  std::size_t most = 0;
  for (std::size_t size = 0; size <= whole.size(); ++size) {
    std::ofstream(path, std::ios::binary | std::ios::trunc) << whole.substr(0, size);
    const ReadBack read = ReadAllOf(path);
    most = std::max(most, read.records.size());
    ASSERT_LE(read.records.size(), 3u);
    ASSERT_EQ(read.records.size(), most) << "no record less than of a shorter file";
    for (std::size_t n = 0; n < read.records.size(); ++n)
      ASSERT_EQ(read.records[n], Records(n + 1, n + 1)[0].bytes) << size;
  }
  EXPECT_EQ(most, 3u);
}

TEST_F(JournalFile, AByteThatChangedIsNeverTakenForARecord) {
  auto writer = Writer();
  for (std::uint64_t step = 1; step <= 3; ++step) ASSERT_TRUE(writer->Write(Records(step, step)));
  ASSERT_TRUE(writer->End());
  const std::string path = Files().front();
  const std::string whole = *ReadFile(path);
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    std::ofstream(path, std::ios::binary | std::ios::trunc) << damaged;
    const ReadBack read = ReadAllOf(path);
    EXPECT_FALSE(read.error.empty()) << at << ": damage is no killed daemon";
    for (std::size_t n = 0; n < read.records.size(); ++n)
      ASSERT_EQ(read.records[n], Records(n + 1, n + 1)[0].bytes) << at;
  }
}

TEST_F(JournalFile, NamesTheStepsThatItLacks) {
  auto writer = Writer();
  std::vector<NumberedRecord> records = Records(1, 10);
  records.erase(records.begin() + 3, records.begin() + 6);
  ASSERT_TRUE(writer->Write(records));
  const ReadBack read = ReadAllOf(folder_);
  EXPECT_EQ(read.records.size(), 3u);
  EXPECT_THAT(read.error, HasSubstr("steps 4 to 6 are not in the journal"));
}

TEST_F(JournalFile, StaysWithinItsLimitAndTheOldestGo) {
  constexpr std::uint64_t kLimit = 2 << 20;
  auto writer = Writer(kLimit, SomeLife(1'700'000'000));
  ASSERT_TRUE(writer->Write(Records(1, 100, 2000)));
  writer = Writer(kLimit, SomeLife(1'700'000'001));
  std::uint64_t most = 0;
  for (std::uint64_t n = 0; n < 100; ++n) {
    ASSERT_TRUE(writer->Write(Records(1 + 50 * n, 50 + 50 * n, 2000)));
    std::uint64_t sum = 0;
    for (const std::string& file : Files()) sum += std::filesystem::file_size(file);
    most = std::max(most, sum);
  }
  EXPECT_FALSE(writer->whole()) << "it says that it can be replayed no more";
  EXPECT_LE(most, kLimit);
  EXPECT_GT(most, kLimit / 2);
  const ReadBack read = ReadAllOf(folder_);
  EXPECT_THAT(read.error, HasSubstr("the beginning of this life is not there any more"));
}

TEST_F(JournalFile, AMissingFileInTheMiddleIsNamed) {
  auto writer = Writer();
  writer = Writer(1 << 20, SomeLife(1'700'000'001));
  for (std::uint64_t n = 0; n < 6; ++n)
    ASSERT_TRUE(writer->Write(Records(1 + 50 * n, 50 + 50 * n, 2000)));
  const std::vector<std::string> files = Files();
  ASSERT_GT(files.size(), 4u);
  std::filesystem::remove(files[files.size() - 2]);
  EXPECT_THAT(ReadAllOf(folder_).error, HasSubstr("the file before it is missing"));
}

// A limit of the process on the size of files stands for a disk without room.
TEST_F(JournalFile, AfterAFullDiskItGoesOnBehindTheLastWholeBlock) {
  auto writer = Writer();
  ASSERT_TRUE(writer->Write(Records(1, 10)));
  ::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  rlimit tight = before;
  tight.rlim_cur = std::filesystem::file_size(Files().front()) + 100;
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &tight), 0);
  const Status refused = writer->Write(Records(11, 20));
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("cannot be written"));
  ASSERT_TRUE(writer->Write(Records(21, 30)));
  const ReadBack read = ReadAllOf(folder_);
  EXPECT_EQ(read.records.size(), 10u);
  EXPECT_THAT(read.error, HasSubstr("steps 11 to 20 are not in the journal"));
}

TEST_F(JournalFile, ZerosAtTheEndAreAPowerCut) {
  auto writer = Writer();
  ASSERT_TRUE(writer->Write(Records(1, 3)));
  std::ofstream(Files().front(), std::ios::binary | std::ios::app) << std::string(5000, '\0');
  const ReadBack read = ReadAllOf(folder_);
  EXPECT_EQ(read.records.size(), 3u) << read.error;
  EXPECT_EQ(read.end, JournalReader::End::kLastTorn);
}

TEST_F(JournalFile, ADiskThatIsFullAtTheBeginningIsTriedAgain) {
  ::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  for (const rlim_t bytes : {10u, 150u}) {  // in the head, in the life
    rlimit tight = before;
    tight.rlim_cur = bytes;
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &tight), 0);
    const auto refused =
        JournalWriter::Open({.folder = folder_, .limit_bytes = 1 << 30}, SomeLife());
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
    EXPECT_FALSE(refused);
    EXPECT_TRUE(Files().empty());
  }
  ASSERT_TRUE(Writer()->Write(Records(1, 3)));
  EXPECT_EQ(ReadAllOf(folder_).records.size(), 3u);
}

TEST_F(JournalFile, OtherLivesGoBeforeThePresentOneWhateverTheirTimes) {
  constexpr std::uint64_t kLimit = 2 << 20;
  ASSERT_TRUE(Writer(kLimit, SomeLife(2'100'000'000))->Write(Records(1, 400, 2000)));  // 2036
  auto writer = Writer(kLimit, SomeLife(1'700'000'000));
  ASSERT_TRUE(writer->Write(Records(1, 700, 2000)));
  EXPECT_TRUE(writer->whole());
  const std::vector<std::string> files = Files();
  EXPECT_THAT(files.front(), HasSubstr("20231114T221320.000Z.000001"));
  EXPECT_THAT(files.back(), ::testing::Not(HasSubstr("20360718T132000.000Z.000001")));
  std::uint64_t sum = 0;
  for (const std::string& file : files) sum += std::filesystem::file_size(file);
  EXPECT_LE(sum, kLimit);
}

TEST_F(JournalFile, WhatIsNoJournalIsRefused) {
  EXPECT_THAT(ReadAllOf(scratch_ / "nothing").error, HasSubstr("no such file or folder"));
  EXPECT_THAT(ReadAllOf(scratch_.path()).error, HasSubstr("the folder has no files *.journal"));
  EXPECT_THAT(ReadAllOf(scratch_.Put("x.csv", "a\n")).error, HasSubstr("*.journal"));
  EXPECT_THAT(ReadAllOf(scratch_.Put("a.000001.journal", std::string(100, 'x'))).error,
              HasSubstr("a block is damaged"));
  EXPECT_FALSE(ReadAllOf(scratch_.Put("b.000001.journal", "")).error.empty());
  scratch_.Put("file", "");
  const auto writer = JournalWriter::Open({.folder = scratch_ / "file"}, SomeLife());
  EXPECT_FALSE(writer);
}

TEST(JournalFields, ALengthThatIsNotFilledMakesNoElements) {
  using Large = std::array<double, 64>;
  std::string bytes;
  WriteFields(std::uint32_t{1000}, &bytes);
  bytes.resize(sizeof(std::uint32_t) + 2 * sizeof(Large));  // two of them are there
  std::vector<Large> read;
  ByteReader reader{bytes};
  ReadFields(&reader, &read);
  EXPECT_FALSE(reader.good);
  EXPECT_LE(read.size(), 3u);
}

}  // namespace
}  // namespace focalfleet::journal
