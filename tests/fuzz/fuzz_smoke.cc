// This program drives one fuzz target without libFuzzer. The committed corpus comes first, then
// inputs of a seed, half of them mutations of the corpus. `<name> CORPUS [RUNS]`; FOCALFLEET_SEED
// picks another seed.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

#include "protocol/base/rng.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace focalfleet {
namespace {

using Bytes = std::vector<std::uint8_t>;

std::vector<Bytes> ReadCorpus(const char* folder) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  std::vector<Bytes> corpus;
  for (const auto& path : paths) {
    std::ifstream in(path, std::ios::binary);
    corpus.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  return corpus;
}

void Mutate(focalfleet::Rng& rng, Bytes* input) {
  for (auto changes = 1 + rng.Below(4); changes > 0; --changes) {
    const std::uint64_t at = rng.Below(input->size() + 1);
    const auto place = input->begin() + static_cast<std::ptrdiff_t>(at);
    const auto byte = static_cast<std::uint8_t>(rng.Below(256));
    const std::uint64_t kind = rng.Below(4);
    if (kind == 0 || place == input->end())
      input->insert(place, byte);
    else if (kind == 1)
      input->erase(place);
    else if (kind == 2)
      *place = byte;
    else
      *place = static_cast<std::uint8_t>(*place ^ 1u << rng.Below(8));
  }
}

int Main(int count, char** arguments) {
  if (count < 2) return 2;
  const std::vector<Bytes> corpus = ReadCorpus(arguments[1]);
  const int runs = count > 2 ? std::atoi(arguments[2]) : 20'000;
  const char* text = std::getenv("FOCALFLEET_SEED");
  const std::uint64_t seed = text == nullptr ? 1 : std::strtoull(text, nullptr, 10);
  std::printf("FOCALFLEET_SEED=%llu, %zu corpus files, %d inputs\n",
              static_cast<unsigned long long>(seed), corpus.size(), runs);
  std::fflush(stdout);
  for (const Bytes& input : corpus) LLVMFuzzerTestOneInput(input.data(), input.size());
  focalfleet::Rng rng(seed);
  for (int i = 0; i < runs; ++i) {
    Bytes input;
    if (!corpus.empty() && rng.Below(2) == 0) {
      input = corpus[rng.Below(corpus.size())];
      Mutate(rng, &input);
    } else {
      input.resize(rng.Below(200));
      for (auto& byte : input) byte = static_cast<std::uint8_t>(rng.Below(256));
    }
    LLVMFuzzerTestOneInput(input.data(), input.size());
  }
  return 0;
}

}  // namespace
}  // namespace focalfleet

int main(int count, char** arguments) { return focalfleet::Main(count, arguments); }
