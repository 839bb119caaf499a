/* status_subscriber DOMAIN is a reader of unit status for any publisher. The program takes samples
   until the writer is gone, and prints how many came. */
#include <dds/dds.h>
#include <stdio.h>
#include <stdlib.h>

#include "focalfleet.h"

#define BATCH 256

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  dds_entity_t participant = dds_create_participant((unsigned)atoi(argv[1]), NULL, NULL);
  dds_entity_t topic = dds_create_topic(participant, &focalfleet_UnitStatus_desc,
                                        "focalfleet/unit_status", NULL, NULL);
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
  dds_entity_t reader = dds_create_reader(participant, topic, qos, NULL);
  if (reader < 0) return 1;
  dds_entity_t waitset = dds_create_waitset(participant);
  dds_waitset_attach(waitset, dds_create_readcondition(reader, DDS_ANY_STATE), 0);
  dds_set_status_mask(reader, DDS_SUBSCRIPTION_MATCHED_STATUS);
  dds_waitset_attach(waitset, reader, 0);
  puts("ready");
  fflush(stdout);

  unsigned long seen = 0;
  dds_subscription_matched_status_t matched = {0};
  while (matched.total_count == 0 || matched.current_count > 0) {
    dds_waitset_wait(waitset, NULL, 0, DDS_SECS(1));
    void* samples[BATCH];
    dds_sample_info_t infos[BATCH];
    int count;
    do {
      samples[0] = NULL;
      count = dds_take(reader, samples, infos, BATCH, BATCH);
      for (int i = 0; i < count; ++i) seen += infos[i].valid_data;
      if (count > 0) dds_return_loan(reader, samples, count);
    } while (count > 0);
    dds_get_subscription_matched_status(reader, &matched);
  }
  printf("%lu\n", seen);
  dds_delete_qos(qos);
  dds_delete(participant);
  return 0;
}
