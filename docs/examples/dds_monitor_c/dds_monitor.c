/* Prints the state of each unit that focalfleetd publishes over DDS: once on joining, then with
   each change. When all units of the fleet were seen, the program says so.

     dds_monitor [DOMAIN] [--once] [--wait SECONDS]

   With --once the program ends when all were seen (exit code 0), or after the wait (1). */
#include <dds/dds.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "focalfleet.h" /* made by idlc from focalfleet.idl */

#define BATCH 256

struct monitor {
  dds_entity_t unit_reader;
  dds_entity_t fleet_reader;
  dds_time_t discovered; /* 0: no daemon yet */
  unsigned units;        /* of the fleet, as the daemon says; 0: not known yet */
  unsigned seen;         /* units with at least one sample */
  unsigned from_history; /* of these, first seen by a sample older than this program */
  dds_time_t began;
  bool* is_seen; /* by unit_id, up to `seen_size` */
  size_t seen_size;
};

static const char* phase_name(uint8_t phase) {
  static const char* const names[] = {"absent",     "identifying", "foreign", "ready",  "staging",
                                      "confirming", "arming",      "armed",   "moving", "homing",
                                      "settling",   "fault",       "silent"};
  /* A code that is not known comes from a later version. */
  return phase < sizeof names / sizeof names[0] ? names[phase] : "of a later version";
}

static dds_entity_t check(dds_entity_t entity, const char* what) {
  if (entity >= 0) return entity;
  fprintf(stderr, "dds_monitor: %s: %s\n", what, dds_strretcode(-entity));
  exit(1);
}

/* Reliable and transient-local: the last state of every unit comes on joining. */
static dds_entity_t make_reader(dds_entity_t participant, const dds_topic_descriptor_t* type,
                                const char* name) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
  dds_entity_t topic = check(dds_create_topic(participant, type, name, NULL, NULL), name);
  dds_entity_t reader = check(dds_create_reader(participant, topic, qos, NULL), name);
  dds_delete_qos(qos);
  return reader;
}

static void see(struct monitor* monitor, const focalfleet_UnitStatus* unit, dds_time_t written) {
  printf("unit %u: %s, theta %.3f..%.3f deg, phi %.3f..%.3f deg, fibre at %.4f, %.4f mm\n",
         (unsigned)unit->unit_id, phase_name(unit->phase), unit->theta_low_deg,
         unit->theta_high_deg, unit->phi_low_deg, unit->phi_high_deg, unit->x_fp_mm, unit->y_fp_mm);
  if (unit->unit_id >= monitor->seen_size) {
    const size_t size = 2 * (size_t)unit->unit_id + 1;
    monitor->is_seen = realloc(monitor->is_seen, size * sizeof(bool));
    if (monitor->is_seen == NULL) abort();
    memset(monitor->is_seen + monitor->seen_size, 0, (size - monitor->seen_size) * sizeof(bool));
    monitor->seen_size = size;
  }
  if (monitor->is_seen[unit->unit_id]) return;
  monitor->is_seen[unit->unit_id] = true;
  ++monitor->seen;
  if (written < monitor->began) ++monitor->from_history;
}

/* Takes all that has come. A sample without valid data only says that a writer is gone. */
static void take(struct monitor* monitor) {
  void* samples[BATCH];
  dds_sample_info_t infos[BATCH];
  const dds_entity_t readers[] = {monitor->fleet_reader, monitor->unit_reader};
  for (int r = 0; r < 2; ++r) {
    int count;
    do {
      samples[0] = NULL; /* the reader lends its own memory */
      count = dds_take(readers[r], samples, infos, BATCH, BATCH);
      for (int i = 0; i < count; ++i) {
        if (!infos[i].valid_data) continue;
        if (r == 0) monitor->units = ((focalfleet_FleetStatus*)samples[i])->units;
        if (r == 1) see(monitor, samples[i], infos[i].source_timestamp);
      }
      if (count > 0) dds_return_loan(readers[r], samples, count);
    } while (count > 0);
  }
}

/* The daemon is discovered when its writer of unit_status matches the reader. */
static void look_for_daemon(struct monitor* monitor) {
  dds_subscription_matched_status_t matched;
  if (monitor->discovered != 0) return;
  if (dds_get_subscription_matched_status(monitor->unit_reader, &matched) == DDS_RETCODE_OK &&
      matched.current_count > 0)
    monitor->discovered = dds_time();
}

int main(int argc, char** argv) {
  unsigned domain = 0;
  bool once = false;
  double wait_s = 10;
  for (int i = 1; i < argc; ++i) {
    if (strcmp(argv[i], "--once") == 0)
      once = true;
    else if (strcmp(argv[i], "--wait") == 0 && i + 1 < argc)
      wait_s = atof(argv[++i]);
    else
      domain = (unsigned)atoi(argv[i]);
  }
  struct monitor monitor = {.began = dds_time()};
  dds_entity_t participant = check(dds_create_participant(domain, NULL, NULL), "participant");
  monitor.unit_reader =
      make_reader(participant, &focalfleet_UnitStatus_desc, "focalfleet/unit_status");
  monitor.fleet_reader =
      make_reader(participant, &focalfleet_FleetStatus_desc, "focalfleet/fleet_status");
  dds_set_status_mask(monitor.unit_reader,
                      DDS_SUBSCRIPTION_MATCHED_STATUS | DDS_DATA_AVAILABLE_STATUS);
  dds_entity_t waitset = check(dds_create_waitset(participant), "waitset");
  dds_waitset_attach(waitset, monitor.unit_reader, 0);
  dds_waitset_attach(waitset, dds_create_readcondition(monitor.fleet_reader, DDS_ANY_STATE), 0);

  const dds_time_t until = once ? monitor.began + (dds_time_t)(wait_s * 1e9) : DDS_NEVER;
  bool all_seen = false;
  while (dds_time() < until && !(once && all_seen)) {
    dds_waitset_wait_until(waitset, NULL, 0, until);
    look_for_daemon(&monitor);
    take(&monitor);
    if (all_seen || monitor.units == 0 || monitor.seen < monitor.units) continue;
    all_seen = true;
    const dds_time_t now = dds_time();
    printf(
        "all %u of %u units seen %.3f s after discovery, %.3f s after joining; %u from history\n",
        monitor.seen, monitor.units, (double)(now - monitor.discovered) / 1e9,
        (double)(now - monitor.began) / 1e9, monitor.from_history);
    fflush(stdout);
  }
  if (!all_seen) printf("%u of %u units seen\n", monitor.seen, monitor.units);
  dds_delete(participant);
  free(monitor.is_seen);
  return all_seen ? 0 : 1;
}
