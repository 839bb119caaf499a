// The command audit shows who commanded what, and checks that the record of it is whole.

#include <fmt/format.h>
#include <pwd.h>

#include <charconv>
#include <memory>
#include <string>
#include <vector>

#include "daemon/cli/client.h"
#include "daemon/cli/operator_commands.h"
#include "daemon/cli/time_text.h"
#include "daemon/store/store_reader.h"

namespace focalfleet::cli {
namespace {

struct AuditOptions {
  std::string since;
  std::string until;
  std::string who;
  std::string verb;
  std::uint32_t limit = 100;
  bool verify = false;
  std::vector<std::string> heads;
  std::string store;
};

/// `uid 1000` of a login name; other texts are taken as they are: `uid 1000`, `token page`.
std::string CallerNamed(const std::string& who) {
  const passwd* const user = who.empty() ? nullptr : ::getpwnam(who.c_str());
  return user == nullptr ? who : fmt::format("uid {}", user->pw_uid);
}

/// The name with the login name behind it, where this machine knows it.
std::string WithLogin(const Json& entry) {
  const std::string name = TextIn(entry, "name");
  const auto uid = entry.find("uid");
  if (uid == entry.end() || !uid->is_number_unsigned()) return name;
  const passwd* const user = ::getpwuid(uid->get<uid_t>());
  return user == nullptr ? name : fmt::format("{} ({})", name, user->pw_name);
}

std::string DescribeEntry(const Json& entry, bool colour_on) {
  const bool taken = entry.value("taken", false);
  const std::uint64_t configuration = CountIn(entry, "configuration");
  const std::string reason = TextIn(entry, "reason");
  return fmt::format(
      "{}  {}  {}, {}  {}  {}{}{}", TextIn(entry, "at"), CountIn(entry, "entry"), WithLogin(entry),
      TextIn(entry, "role"), Paint(colour_on, Colour::kBold, TextIn(entry, "verb")),
      Paint(colour_on, taken ? Colour::kGreen : Colour::kRed, taken ? "taken" : "refused"),
      configuration == 0 ? "" : fmt::format(", configuration {}", configuration),
      reason.empty() ? "" : ": " + reason);
}

Result<Json> ArgumentsFor(const AuditOptions& options) {
  if (options.verify) return Json{{"heads", options.heads}};
  Json args{{"limit", options.limit}, {"name", CallerNamed(options.who)}, {"verb", options.verb}};
  const WallTime now = WallTime::Now();
  if (!options.since.empty()) {
    FOCALFLEET_TRY_ASSIGN(const WallTime since, InstantOf(options.since, now));
    args["since_ns"] = since.ns;
  }
  if (!options.until.empty()) {
    FOCALFLEET_TRY_ASSIGN(const WallTime until, InstantOf(options.until, now));
    args["until_ns"] = until.ns;
  }
  return args;
}

/// A chain that is broken is bad input: exit code 1.
ExitCode ShowVerdict(const Context& context, const Json& verdict) {
  if (!verdict.value("whole", false))
    return Report(context, {ErrorCode::kInvalid, TextIn(verdict, "flaw")});
  if (context.json) PrintJson(verdict);
  Say(context,
      fmt::format("the audit is whole: {}, head {}",
                  Count(CountIn(verdict, "entries"), "entry", "entries"), TextIn(verdict, "head")));
  return ExitCode::kOk;
}

/// The verdict on the store's file itself, without a daemon.
ExitCode VerifyFile(const Context& context, const AuditOptions& options) {
  std::vector<AuditHead> heads;
  for (const std::string& text : options.heads) {
    const auto head = HeadOf(text);
    if (!head)
      return Report(context, {ErrorCode::kInvalid, "'" + text + "' is no head: ENTRY:SHA256"});
    heads.push_back(*head);
  }
  const auto reader = StoreReader::Open(options.store);
  if (!reader) return Report(context, reader.error());
  const auto verdict = (*reader)->CheckAudit(heads);
  if (!verdict) return Report(context, verdict.error());
  return ShowVerdict(context, {{"whole", !verdict->flaw},
                               {"entries", verdict->entries},
                               {"head", Text(verdict->head)},
                               {"flaw", verdict->flaw.value_or("")}});
}

ExitCode RunAudit(const Context& context, const AuditOptions& options) {
  if (options.verify && !options.store.empty()) return VerifyFile(context, options);
  const auto args = ArgumentsFor(options);
  if (!args) return Report(context, args.error());
  const auto answer =
      Ask(context, {.verb = options.verify ? "audit_check" : "audit", .args = *args});
  if (!answer) return Report(context, answer.error());
  if (options.verify) return ShowVerdict(context, *answer);
  if (context.json) PrintJson(*answer);
  for (const Json& entry : ListIn(*answer, "entries"))
    Say(context, DescribeEntry(entry, context.colour_out));
  if (ListIn(*answer, "entries").empty()) Say(context, "nothing of that kind was commanded");
  return ExitCode::kOk;
}

}  // namespace

void AddAuditCommand(CommandLine* line) {
  CLI::App* audit =
      AddCommand(&line->app, "audit", "Show who commanded what, and check that the record is whole",
                 "  focalfleet audit --since 12h\n  focalfleet audit --who maria --verb apply\n"
                 "  focalfleet audit --verify --head 4711:0f3a...\n"
                 "  focalfleet audit --verify --store /var/lib/focalfleet/focalfleet.db");
  auto options = std::make_shared<AuditOptions>();
  audit->add_option("--since", options->since, "Since then: 2h, or a time of UTC");
  audit->add_option("--until", options->until, "Until then: 2h, or a time of UTC");
  audit->add_option("--who", options->who, "A login name, 'uid 1000' or 'token NAME'");
  audit->add_option("--verb", options->verb, "Of this verb alone, as docs/access.md has it");
  audit->add_option("--limit", options->limit, "The newest of them, at most 1000")
      ->capture_default_str();
  CLI::Option* verify =
      audit->add_flag("--verify", options->verify, "Follow the chain of hashes over all entries");
  audit
      ->add_option("--head", options->heads,
                   "ENTRY:SHA256 that must be part of it, as the journal has them each hour")
      ->allow_extra_args(false)
      ->needs(verify);
  audit->add_option("--store", options->store, "Check this file, without the daemon")
      ->needs(verify);
  OnChosen(line, audit, options, RunAudit);
}

}  // namespace focalfleet::cli
