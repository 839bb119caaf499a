// The commands token add, list and revoke work on the file of tokens. The daemon reads it anew when
// it changes.

#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "daemon/access/token.h"
#include "daemon/cli/client.h"
#include "daemon/cli/operator_commands.h"
#include "daemon/cli/time_text.h"
#include "daemon/files/descriptor.h"
#include "daemon/files/text_file.h"

namespace focalfleet::cli {
namespace {

constexpr const char* kTokensFile = "/etc/focalfleet/tokens.csv";
constexpr std::int64_t kSecondsPerDay = 86'400;

struct TokenOptions {
  std::string file = kTokensFile;
  std::string name;
  std::string role;
  std::uint32_t days = 0;
};

std::int64_t NowS() { return WallTime::Now().ns / 1'000'000'000; }
std::string TimeOf(std::int64_t seconds) { return ToIso8601({seconds * 1'000'000'000}); }

/// Two commands at once must not undo each other's change.
class TokensLock {
 public:
  static Result<TokensLock> Take(const std::string& file) {
    const std::string path = file + ".lock";
    TokensLock lock;
    lock.descriptor_ =
        Descriptor(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
    if (lock.descriptor_.get() < 0 || ::flock(lock.descriptor_.get(), LOCK_EX) != 0)
      return FailErrno(path, "cannot be locked", errno);
    return lock;
  }

 private:
  Descriptor descriptor_;
};

/// The file is replaced as a whole. Its owner and group stay, so that the daemon can still read it;
/// a new one gets the group of its folder.
Status KeepTokens(const std::string& path, const std::vector<Token>& tokens) {
  struct stat before {};
  const bool is_new = ::stat(path.c_str(), &before) != 0;
  if (is_new) {
    const std::string folder = std::filesystem::path(path).parent_path().string();
    if (::stat(folder.empty() ? "." : folder.c_str(), &before) != 0)
      return FailErrno(path, "cannot be written", errno);
  }
  const std::string beside = path + ".new";
  ::unlink(beside.c_str());
  const Descriptor file(
      ::open(beside.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (file.get() < 0) return FailErrno(path, "cannot be written", errno);
  int failed = WriteAll(file.get(), FormatTokens(tokens));
  if (failed == 0 && ::geteuid() == 0 &&
      ::fchown(file.get(), is_new ? 0 : before.st_uid, before.st_gid) != 0)
    failed = errno;
  if (failed == 0 && ::fchmod(file.get(), 0640) != 0) failed = errno;
  if (failed == 0 && ::fsync(file.get()) != 0) failed = errno;
  if (failed == 0 && ::rename(beside.c_str(), path.c_str()) != 0) failed = errno;
  if (failed == 0) return {};
  ::unlink(beside.c_str());
  return FailErrno(path, "cannot be written", failed);
}

Json JsonOfToken(const Token& token) {
  return {{"name", token.name},
          {"role", Name(token.role)},
          {"made", TimeOf(token.made_s)},
          {"expires", TimeOf(token.expires_s)},
          {"revoked", token.revoked_s == 0 ? Json() : Json(TimeOf(token.revoked_s))},
          {"state", Name(StateOf(token, NowS()))}};
}

Result<std::string> AddTo(const TokenOptions& options, Token* added) {
  const auto role = RoleOf(options.role);
  if (!role) return Fail(ErrorCode::kInvalid, "there is no role '" + options.role + "'");
  FOCALFLEET_TRY_ASSIGN(const TokensLock lock, TokensLock::Take(options.file));
  std::vector<Token> tokens;
  if (::access(options.file.c_str(), F_OK) == 0) {
    FOCALFLEET_TRY_ASSIGN(tokens, ReadTokens(options.file));
  }
  const std::int64_t now_s = NowS();
  FOCALFLEET_TRY_ASSIGN(
      std::string secret,
      AddToken(options.name, *role, now_s, now_s + options.days * kSecondsPerDay, &tokens));
  FOCALFLEET_TRY(KeepTokens(options.file, tokens));
  *added = tokens.back();
  return secret;
}

ExitCode RunTokenAdd(const Context& context, const TokenOptions& options) {
  Token added;
  const auto secret = AddTo(options, &added);
  if (!secret) return Report(context, secret.error());
  if (context.json) {
    Json answer = JsonOfToken(added);
    answer["token"] = *secret;
    PrintJson(answer);
  }
  Say(context, *secret);
  if (!context.json && !context.quiet)
    Complain(fmt::format("token {} of a {} until {}; it is shown this once and kept nowhere\n",
                         added.name, Name(added.role), TimeOf(added.expires_s)));
  return ExitCode::kOk;
}

ExitCode RunTokenList(const Context& context, const TokenOptions& options) {
  const auto tokens = ReadTokens(options.file);
  if (!tokens) return Report(context, tokens.error());
  Json list = Json::array();
  for (const Token& token : *tokens) {
    list.push_back(JsonOfToken(token));
    Say(context, fmt::format("{:8} {:9} until {}  {}", Name(StateOf(token, NowS())),
                             Name(token.role), TimeOf(token.expires_s), token.name));
  }
  if (context.json) PrintJson({{"tokens", std::move(list)}});
  if (tokens->empty()) Say(context, "no tokens");
  return ExitCode::kOk;
}

Status RevokeIn(const TokenOptions& options) {
  FOCALFLEET_TRY_ASSIGN(const TokensLock lock, TokensLock::Take(options.file));
  FOCALFLEET_TRY_ASSIGN(auto tokens, ReadTokens(options.file));
  FOCALFLEET_TRY(RevokeToken(options.name, NowS(), &tokens));
  return KeepTokens(options.file, tokens);
}

ExitCode RunTokenRevoke(const Context& context, const TokenOptions& options) {
  if (const Status done = RevokeIn(options); !done) return Report(context, done.error());
  const std::string text = "token " + options.name + " is revoked";
  if (context.json) PrintJson({{"text", text}});
  Say(context, text);
  return ExitCode::kOk;
}

std::shared_ptr<TokenOptions> OptionsOf(CLI::App* command) {
  auto options = std::make_shared<TokenOptions>();
  command->add_option("--file", options->file, "The file of tokens, [http] tokens")
      ->capture_default_str();
  return options;
}

}  // namespace

void AddTokenCommands(CommandLine* line) {
  CLI::App* token =
      AddCommand(&line->app, "token", "Make, list and revoke tokens for the HTTP door",
                 "  focalfleet token add night-page --role viewer --days 30\n"
                 "  focalfleet token list\n  focalfleet token revoke night-page");
  token->require_subcommand(1);

  CLI::App* add =
      AddCommand(token, "add", "Make a token and show it once. The file keeps its hash alone",
                 "  focalfleet token add night-page --role viewer --days 30");
  auto added = OptionsOf(add);
  add->add_option("NAME", added->name, "For the audit: letters, digits, - . _")->required();
  OneOf(add->add_option("--role", added->role, "What its bearer may do"),
        {"viewer", "operator", "engineer"})
      ->required();
  add->add_option("--days", added->days, "Days until it ends")
      ->required()
      ->check(CLI::Range(1, 3650));
  OnChosen(line, add, added, RunTokenAdd);

  CLI::App* list = AddCommand(token, "list", "List all tokens, also those that have ended",
                              "  focalfleet token list --file tokens.csv");
  OnChosen(line, list, OptionsOf(list), RunTokenList);

  CLI::App* revoke =
      AddCommand(token, "revoke", "End a token now", "  focalfleet token revoke night-page");
  auto revoked = OptionsOf(revoke);
  revoke->add_option("NAME", revoked->name, "The token's name")->required();
  OnChosen(line, revoke, revoked, RunTokenRevoke);
}

}  // namespace focalfleet::cli
