/* Reads an answer of the JSON interface the way the protocol's own reader is documented to: the first occurrence
   of a section, of a key behind it, and what follows the quote and the colon. Prints section/key and the numbers.
   Standard input: what has come over the wire. Exit status 1: a required key is missing or no number follows. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct entry {
  const char *section, *key;
  int count, required;
};

static const struct entry entries[] = {
    {"", "timestamp", 1, 1},  {"imu", "gyro", 3, 1},        {"imu", "accel_body", 3, 1},
    {"", "position", 3, 1},   {"", "attitude", 3, 0},       {"", "quaternion", 4, 0},
    {"", "velocity", 3, 1},   {"", "rng_1", 1, 0},          {"windvane", "direction", 1, 0},
    {"windvane", "speed", 1, 0}, {"", "airspeed", 1, 0},    {"", "no_time_sync", 1, 0},
    {"battery", "voltage", 1, 0}, {"rc", "rc_1", 1, 0},     {"", "velocity_wind", 3, 0},
};

static int print_numbers(const struct entry *wanted, const char *at) {
  double v[4] = {0};
  int got = wanted->count;
  if (wanted->count == 1)
    v[0] = atof(at);
  else if (wanted->count == 3)
    got = sscanf(at, "[%lf, %lf, %lf]", &v[0], &v[1], &v[2]);
  else
    got = sscanf(at, "[%lf, %lf, %lf, %lf]", &v[0], &v[1], &v[2], &v[3]);
  if (got != wanted->count) return 1;
  printf("%s%s%s", wanted->section, *wanted->section ? "/" : "", wanted->key);
  for (int i = 0; i < wanted->count; i++) printf(" %.17g", v[i]);
  printf("\n");
  return 0;
}

int main(void) {
  static char buffer[65536];
  size_t size = fread(buffer, 1, sizeof buffer - 1, stdin);
  char *end, *start;
  buffer[size] = 0;
  end = strrchr(buffer, '\n');
  if (!end || end == buffer) return 1;
  *end = 0;
  start = strrchr(buffer, '\n');
  if (!start) return 1;
  start++;
  for (size_t i = 0; i < sizeof entries / sizeof *entries; i++) {
    const struct entry *wanted = &entries[i];
    const char *at = strstr(start, wanted->section);
    if (at) at = strstr(at + strlen(wanted->section) + 1, wanted->key);
    if (!at) {
      if (wanted->required) return 1;
      continue;
    }
    if (print_numbers(wanted, at + strlen(wanted->key) + 2)) return 1;
  }
  return 0;
}
