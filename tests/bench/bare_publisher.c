/* bare_publisher is the least that a publisher of unit status can do: plain C, one topic, the
   shipped type and QoS, packed writes. Any higher cost of StatusPublisher is its own.

     bare_publisher DOMAIN UNITS CYCLES HZ

   The program waits for a reader, publishes all units CYCLES times at HZ, and prints: cpu_s
   samples. */
#include <dds/dds.h>
#include <dds/ddsc/dds_public_impl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>

#include "focalfleet.h"

static double cpu_s(void) {
  struct rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  return (double)(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * (double)(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  const unsigned domain = (unsigned)atoi(argv[1]);
  const unsigned units = (unsigned)atoi(argv[2]);
  const int cycles = atoi(argv[3]);
  const dds_duration_t period = DDS_NSECS_IN_SEC / atoi(argv[4]);

  dds_entity_t participant = dds_create_participant(domain, NULL, NULL);
  dds_write_set_batch(true);
  dds_entity_t topic = dds_create_topic(participant, &focalfleet_UnitStatus_desc,
                                        "focalfleet/unit_status", NULL, NULL);
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, 0);
  dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
  dds_qset_liveliness(qos, DDS_LIVELINESS_AUTOMATIC, DDS_SECS(2));
  dds_qset_writer_data_lifecycle(qos, false);
  dds_entity_t writer = dds_create_writer(participant, topic, qos, NULL);
  if (writer < 0) return 1;
  dds_publication_matched_status_t matched = {0};
  while (matched.current_count == 0) {
    dds_get_publication_matched_status(writer, &matched);
    dds_sleepfor(DDS_MSECS(1));
  }

  focalfleet_UnitStatus* status = calloc(units, sizeof *status);
  const double before = cpu_s();
  const dds_time_t began = dds_time();
  for (int cycle = 0; cycle < cycles; ++cycle) {
    for (unsigned i = 0; i < units; ++i) {
      status[i].unit_id = i + 1;
      status[i].time_ns = cycle;
      status[i].theta_low_deg = cycle * 0.25;
      status[i].phase = focalfleet_PHASE_MOVING;
      if (dds_write(writer, &status[i]) != DDS_RETCODE_OK) return 1;
    }
    dds_write_flush(writer);
    const dds_duration_t left = began + (cycle + 1) * period - dds_time();
    if (left > 0) dds_sleepfor(left);
  }
  printf("%.6f %lu\n", cpu_s() - before, (unsigned long)cycles * units);
  dds_delete_qos(qos);
  dds_delete(participant);
  free(status);
  return 0;
}
