#include "daemon/plane/plane_link.h"

#include <dds/dds.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>
#include <thread>
#include <utility>

#include "daemon/dds/credential_watch.h"
#include "daemon/dds/cyclone.h"
#include "daemon/dds/late_join.h"
#include "daemon/loop/thread_name.h"
#include "daemon/plane/plane_codec.h"
#include "focalfleet.h"  // generated from focalfleet.idl

namespace focalfleet {

using namespace dds_internal;

namespace {

constexpr std::int32_t kDepth = 16;  // messages of one sender between two turns of the thread

/// Renewed credentials: both participants speak for so long, far longer than a handshake takes.
constexpr std::chrono::seconds kBeside(10);

std::string PartitionOf(std::uint32_t sector) { return SectorPartition(sector); }

template <class Message>
void Put(Message message, std::vector<Message>* list) {
  if (list->size() >= PlaneLink::kMailMax) list->erase(list->begin());
  list->push_back(std::move(message));
}

}  // namespace

/// The mail and its counters outlive the joined domain.
class PlaneLink::Impl {
 public:
  explicit Impl(Options options) : options_(std::move(options)) {}

  void Take(const char* topic, const focalfleet_PlaneMessage& sample) {
    const std::string_view body(reinterpret_cast<const char*>(sample.body._buffer),
                                sample.body._length);
    const std::lock_guard lock(mutex_);
    ++counters_.received;
    counters_.received_bytes += body.size();
    bool good = sample.format == kPlaneFormat;
    const auto keep = [&](auto decoded, auto* list) {
      good = decoded.has_value();
      if (good) Put(std::move(*decoded), list);
    };
    if (good && topic == kPlaneOrderTopic) keep(DecodePlaneOrder(body), &mail_.orders);
    if (good && topic == kSectorReportTopic) keep(DecodeSectorReport(body), &mail_.reports);
    if (good && topic == kBorderNewsTopic) keep(DecodeBorderNews(body), &mail_.news);
    if (!good) ++counters_.refused;
  }
  PlaneMail TakeMail() {
    const std::lock_guard lock(mutex_);
    return std::exchange(mail_, {});
  }
  void CountSent(std::size_t bytes) {
    const std::lock_guard lock(mutex_);
    ++counters_.sent;
    counters_.sent_bytes += bytes;
  }
  PlaneLinkCounters counters() const {
    const std::lock_guard lock(mutex_);
    return counters_;
  }
  void Arrived() const { options_.arrived(); }

  /// The domain, once it is joined.
  class Joined {
   public:
    static Result<std::unique_ptr<Joined>> Create(Impl* mail) {
      auto joined = std::make_unique<Joined>();
      joined->mail_ = mail;
      const DdsOptions& dds = mail->options_.dds;
      FOCALFLEET_TRY_ASSIGN(joined->participant_, Participant::Join(dds));
      const auto topic = [&](const char* name) {
        return MakeTopic(joined->participant_, focalfleet_PlaneMessage_desc, name);
      };
      FOCALFLEET_TRY_ASSIGN(joined->orders_, topic(kPlaneOrderTopic));
      FOCALFLEET_TRY_ASSIGN(joined->reports_, topic(kSectorReportTopic));
      // A coordinator's credentials do not name it.
      if (mail->options_.sector) {
        FOCALFLEET_TRY_ASSIGN(joined->news_, topic(kBorderNewsTopic));
      }
      FOCALFLEET_TRY(joined->Open());
      joined->thread_ = std::jthread([raw = joined.get()] { raw->Run(); });
      return joined;
    }
    Joined() = default;
    Joined(const Joined&) = delete;
    Joined& operator=(const Joined&) = delete;
    ~Joined() {
      if (!thread_.joinable()) return;
      dds_set_guardcondition(ending_, true);
      thread_.join();
    }

    /// `to` is the sector whose partition carries the message.
    bool Send(const char* topic, std::uint32_t to, std::uint32_t from, std::uint64_t epoch,
              const std::string& body) {
      const auto writer = WriterOf(topic, to);
      if (!writer) return false;
      focalfleet_PlaneMessage sample{};
      sample.epoch = epoch;
      sample.sector = to;
      sample.sender = from;
      sample.format = kPlaneFormat;
      sample.body._length = sample.body._maximum = static_cast<std::uint32_t>(body.size());
      sample.body._buffer =
          reinterpret_cast<std::uint8_t*>(const_cast<char*>(body.data()));  // DDS only reads it
      const dds_return_t code = dds_write(*writer, &sample);
      dds_write_flush(*writer);  // the process batches what all writers write
      return code >= 0;
    }

   private:
    Status Open() {
      const dds_entity_t waitset = dds_create_waitset(participant_.get());
      if (waitset < 0) return DdsFailure("make a waitset", waitset);
      waitset_ = waitset;
      ending_ = dds_create_guardcondition(participant_.get());
      if (ending_ < 0) return DdsFailure("make a condition", ending_);
      if (const dds_return_t code = dds_waitset_attach(waitset_, ending_, 0); code < 0)
        return DdsFailure("watch a condition", code);
      const auto& sector = mail_->options_.sector;
      if (!sector) return Listen(reports_, kSectorReportTopic, SectorPartition({}));
      FOCALFLEET_TRY(Listen(orders_, kPlaneOrderTopic, PartitionOf(*sector)));
      return Listen(news_, kBorderNewsTopic, SectorPartition({}));
    }

    Status Listen(Handle topic, const char* name, const std::string& partition) {
      FOCALFLEET_TRY_ASSIGN(const Handle reader,
                            MakeListener(participant_, topic, kDepth, partition));
      const dds_entity_t ready = dds_create_readcondition(reader, DDS_ANY_STATE);
      if (ready < 0) return DdsFailure("watch a reader", ready);
      if (const dds_return_t code = dds_waitset_attach(waitset_, ready, 0); code < 0)
        return DdsFailure("watch a reader", code);
      readers_.emplace_back(name, reader);
      return {};
    }

    std::optional<Handle> WriterOf(const char* topic, std::uint32_t sector) {
      const auto [it, made] = writers_.try_emplace({topic, sector}, 0);
      if (!made) return it->second;
      const Handle of = topic == kPlaneOrderTopic     ? orders_
                        : topic == kSectorReportTopic ? reports_
                                                      : news_;
      const auto writer = MakeTalker(participant_, of, kDepth, PartitionOf(sector));
      if (!writer) {
        writers_.erase(it);
        return std::nullopt;
      }
      return it->second = *writer;
    }

    void Run() {
      NameThisThread("plane");
      for (;;) {
        bool ending = false;
        dds_read_guardcondition(ending_, &ending);
        if (ending) return;
        bool any = false;
        for (const auto& [topic, reader] : readers_) any |= Drain(topic, reader);
        if (any) mail_->Arrived();
        dds_waitset_wait(waitset_, nullptr, 0, DDS_SECS(1));
      }
    }

    bool Drain(const char* topic, Handle reader) {
      bool any = false;
      for (;;) {
        std::array<void*, 16> samples{};  // null asks Cyclone for loans
        std::array<dds_sample_info_t, 16> infos;
        const dds_return_t count =
            dds_take(reader, samples.data(), infos.data(), samples.size(), samples.size());
        if (count <= 0) return any;
        for (std::size_t n = 0; n < static_cast<std::size_t>(count); ++n) {
          if (!infos[n].valid_data) continue;
          mail_->Take(topic, *static_cast<const focalfleet_PlaneMessage*>(samples[n]));
          any = true;
        }
        dds_return_loan(reader, samples.data(), count);
      }
    }

    Impl* mail_ = nullptr;
    Participant participant_;
    Handle orders_ = 0;
    Handle reports_ = 0;
    Handle news_ = 0;
    Handle waitset_ = 0;
    Handle ending_ = 0;
    std::vector<std::pair<const char*, Handle>> readers_;
    std::map<std::pair<const char*, std::uint32_t>, Handle> writers_;
    std::jthread thread_;
  };

  void Join() {
    AddJoin();
    if (options_.dds.security.empty()) return;
    credentials_ = std::make_unique<CredentialWatch>(CredentialWatch::Options{
        .folder = options_.dds.security, .renew = [this](WallTime) { Renew(); }});
  }
  void Leave() {
    {
      const std::lock_guard lock(joins_mutex_);
      leaving_ = true;
    }
    leave_.notify_all();
    credentials_.reset();
    joins_.clear();
  }
  /// True: DDS took the message from one participant at least.
  template <class... Args>
  bool Send(const Args&... args) {
    bool sent = false;
    for (const auto& join : Joins())
      if (Joined* const joined = join->get(); joined != nullptr) sent |= joined->Send(args...);
    return sent;
  }

 private:
  using JoinList = std::vector<std::shared_ptr<LateJoin<Joined>>>;
  JoinList Joins() const {
    const std::lock_guard lock(joins_mutex_);
    return joins_;
  }
  std::shared_ptr<LateJoin<Joined>> AddJoin() {
    auto join = std::make_shared<LateJoin<Joined>>(LateJoin<Joined>::Options{
        .join = [this] { return Joined::Create(this); }, .tell = options_.tell});
    const std::lock_guard lock(joins_mutex_);
    joins_.push_back(join);
    return join;
  }
  /// On the thread of the watch. A participant with new credentials joins beside the old one, and
  /// both say everything until all others have had time to find the new one.
  void Renew() {
    const auto next = AddJoin();
    std::unique_lock lock(joins_mutex_);
    const auto is_leaving = [this] { return leaving_; };
    while (next->get() == nullptr)
      if (leave_.wait_for(lock, std::chrono::seconds(1), is_leaving)) return;
    if (leave_.wait_for(lock, kBeside, is_leaving)) return;
    JoinList old = std::exchange(joins_, {next});
    lock.unlock();
    old.clear();
  }

  Options options_;
  mutable std::mutex mutex_;
  PlaneMail mail_;
  PlaneLinkCounters counters_;
  mutable std::mutex joins_mutex_;
  std::condition_variable leave_;
  bool leaving_ = false;
  JoinList joins_;  // two while credentials are renewed
  std::unique_ptr<CredentialWatch> credentials_;
};

PlaneLink::PlaneLink(Options options) : impl_(std::make_shared<Impl>(std::move(options))) {
  impl_->Join();
}
PlaneLink::~PlaneLink() { impl_->Leave(); }

namespace {
constexpr std::uint32_t kCoordinator = focalfleet_PLANE_COORDINATOR;
}  // namespace

void PlaneLink::Send(const PlaneOrder& order) {
  const std::string body = Encode(order);
  if (impl_->Send(kPlaneOrderTopic, order.sector, kCoordinator, order.epoch.number, body))
    impl_->CountSent(body.size());
}

void PlaneLink::Send(const SectorReport& report) {
  const std::string body = Encode(report);
  if (impl_->Send(kSectorReportTopic, report.sector, report.sector, report.accepted.number, body))
    impl_->CountSent(body.size());
}

void PlaneLink::Send(const BorderNews& news) {
  const std::string body = Encode(news);
  if (impl_->Send(kBorderNewsTopic, news.sector, news.sector, news.epoch.number, body))
    impl_->CountSent(body.size());
}

PlaneMail PlaneLink::Take() { return impl_->TakeMail(); }
PlaneLinkCounters PlaneLink::counters() const { return impl_->counters(); }

}  // namespace focalfleet
