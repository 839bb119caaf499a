// The maxima of the whole system, and the relations between them. Every loop, queue and table of
// the core is bounded by an entry here.
#pragma once

#include <cstdint>

namespace focalfleet::limits {

inline constexpr std::uint32_t kUnits = 32'768;
inline constexpr std::uint32_t kBuses = 512;
inline constexpr std::uint32_t kSectors = 64;          // of a plane
inline constexpr std::uint32_t kRoundsPerPlane = 12;   // of a configuration over sectors
inline constexpr std::uint32_t kBorderEnds = 4096;     // of a sector in a round
inline constexpr std::uint32_t kNodesPerBus = 128;     // electrical: a CAN segment carries no more
inline constexpr std::uint32_t kSegmentsPerAxis = 15;  // of a move; two 4-bit counts on the wire
// Units whose reach overlaps; 6 to 30 are usual.
inline constexpr std::uint32_t kNeighboursPerUnit = 256;
inline constexpr std::uint32_t kSensorsPerUnit = 16;         // four a frame, the part in three bits
inline constexpr std::int32_t kPositionMax = (1 << 23) - 1;  // vectors; 24 bits on the wire
inline constexpr std::uint32_t kOffsetTicksMax = (1u << 24) - 1;  // 100 us each: 28 minutes
// The waits double: 31 times the first wait in all.
inline constexpr std::uint32_t kRequestRetries = 4;
inline constexpr std::uint32_t kStageRetries = 3;
inline constexpr std::uint32_t kRoundsPerConfiguration = 6;
inline constexpr std::uint32_t kMovesReserved = 1024;  // numbers that the store has marked as taken
inline constexpr std::uint32_t kFramesPerBusQueued = 4096;
// Frames that a turn takes from all buses together: 64 buses of 1024 each, as ports give them. Some
// 90 ms at 1.4 us a frame; with 512 buses full at once it would be 0.7 s until a stop is looked at.
inline constexpr std::uint32_t kFramesPerStep = 65'536;
inline constexpr std::uint32_t kSpotsPerExposure = 131'072;  // fibres, fiducials, dust
inline constexpr std::uint32_t kFiducials = 4096;
inline constexpr std::uint32_t kCsvColumns = 1024;         // moves.csv has some 30
inline constexpr std::uint32_t kCsvRowBytes = 1u << 20;    // ends the search for the end of a quote
inline constexpr std::uint32_t kBadRowsReported = 20;      // of a table; the others are counted
inline constexpr std::uint32_t kExposureBytes = 1u << 28;  // an image of the sensor and its spots
inline constexpr std::uint32_t kExposureIdBytes = 64;      // a name in logs and alarms
inline constexpr std::uint32_t kCameraFiles = 16'384;      // in the camera's folder at once
inline constexpr std::uint32_t kControlClients = 64;
inline constexpr std::uint32_t kControlClientsReserved =
    8;  // besides those, for clients that send a stop
// Requests of a client that are not answered yet; its next lines are not taken until one is. A
// program asks one thing after another. A page has a status, a state and a question open at once.
inline constexpr std::uint32_t kControlRequestsOpen = 8;
// Bytes of a request line. Each costs the core 10 to 30 ns, during which a stop waits. Targets of
// 32,768 units with names of 30 characters fit.
inline constexpr std::uint32_t kControlLineBytes = 2u << 20;
// The same of a viewer, whose longest request is a list of all units.
inline constexpr std::uint32_t kViewerLineBytes = 1u << 18;
// The same of an engineer's `model_load`. A model of 5000 units has 1.4 MB, and up to 0.4 MB more
// for each effect that all of them have.
inline constexpr std::uint32_t kModelLineBytes = 16u << 20;
// Rows that wait for the store, in bytes of memory: some 150,000 of a disabled unit. With more, no
// command is taken that adds others, so that a full disk does not fill the memory, too. A
// configuration of 32,768 units writes a fifth of it at once.
inline constexpr std::uint32_t kRowBytesWaiting = 64u << 20;
inline constexpr std::uint32_t kControlDepth = 16;  // of lists and objects within one another
inline constexpr std::uint32_t kTableDepth =
    64;  // the same of a table in JSON, or of elements in XML
inline constexpr std::uint32_t kControlValues = 2 * kUnits;  // of a request, over all its lists
inline constexpr std::uint32_t kVerbBytes = 32;
// Reasons and names, as DDS carries them (focalfleet.idl).
inline constexpr std::uint32_t kTextBytes = 255;

// The largest focal plane in view, 20,000 units at 100 a bus, fits with room.
static_assert(kUnits >= 20'000 && kBuses * 100 >= kUnits);
static_assert(kNodesPerBus < 255, "255 is the broadcast address");
static_assert(kSensorsPerUnit <= 4 * 8, "four a frame, the part in three bits");
static_assert(kSegmentsPerAxis <= 15, "4-bit count in StageBegin and Confirm");
static_assert(kControlValues >= kUnits + 16, "a request that names every unit");
static_assert(kControlLineBytes >= kUnits * (30 + 30), "targets of every unit, with names");
static_assert(kViewerLineBytes >= kUnits * 7, "the numbers of every unit, up to 999,999");
static_assert(kSpotsPerExposure >= 2 * (kUnits + kFiducials), "a plate seen with as much dust");
static_assert(kCsvRowBytes >= kUnits * 11, "faults.csv may name every unit in one cell");
static_assert(kExposureBytes >= 11'000u * 11'000u * 2 + kSpotsPerExposure * 128,
              "16 bits a pixel, and 128 characters a spot");
// The upload of a whole bus may be queued at once: the begin and all segments of both axes, at the
// usual 8 segments.
static_assert(kFramesPerBusQueued >= kNodesPerBus * (1 + 2 * 8));

}  // namespace focalfleet::limits
