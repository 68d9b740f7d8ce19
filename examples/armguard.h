/* A client of `armguard serve` in one header, for loops in C and C++ on the machine of the
 * service: sends measured joints and desired velocities, waits for the command to the
 * robots, and says stop when that is not received in time.
 *
 *     struct armguard guard;
 *     armguard_open(&guard, 47800, NULL);          // 0, or a sentence is on stderr
 *     armguard_claim(&guard);                      // to command; not to send states
 *     for (;;) {
 *         // a robot that was stopped is held until it gets zero once, or is engaged
 *         armguard_cycle(&guard, q, v, guard.held ? zero : desired, stamp); // 0: it is silent
 *         send_to_robots(guard.velocity);          // always, also while they stop
 *     }
 *
 * No threads, nothing allocated. docs/service.md explains the records. */
#ifndef ARMGUARD_H
#define ARMGUARD_H
#include <arpa/inet.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include "blake2s.h"

#ifndef ARMGUARD_WATCHDOG
#define ARMGUARD_WATCHDOG 0.1 /* an answer that takes longer is a stop [s] */
#endif
enum { ARMGUARD_JOINTS = 64, ARMGUARD_MESSAGE = 8192, ARMGUARD_SEAL = 16 };
enum { ARMGUARD_ROBOTS = 31 };
enum {
    ARMGUARD_FOLLOW = 0,
    ARMGUARD_HOLD = 5, /* a robot waits, see `held` */
    ARMGUARD_STOP = 10,
    ARMGUARD_BRAKE = 20,
    ARMGUARD_HARDWARE_STOP = 30
};
/* Why a robot was stopped last: after these two it goes on only when it is engaged. */
enum { ARMGUARD_STOP_ORDERED = 40, ARMGUARD_RESTARTED = 41 };

/* Kinds of messages, and their records. */
enum { ARMGUARD_HELLO = 1, ARMGUARD_WELCOME = 2, ARMGUARD_STATE = 3, ARMGUARD_COMMAND = 5 };
enum { ARMGUARD_CLAIM = 7, ARMGUARD_GRANT = 8, ARMGUARD_BYE = 13, ARMGUARD_CHALLENGE = 14 };
enum { ARMGUARD_ORDER_STOP = 12, ARMGUARD_FRAME = 16, ARMGUARD_HEALTH = 17 };
/* Causes of a stop by a reflex, see armguard_obey. */
enum { ARMGUARD_REFLEX_STOPPED = 16, ARMGUARD_REFLEX_SILENT = 17 };

struct armguard_header {
    uint32_t magic;
    uint8_t version, kind;
    uint16_t length;
    uint64_t session, scene, sender, sequence;
    int64_t stamp;
};
struct armguard_hello {
    uint32_t role, every;
    uint8_t cookie[16];
};
struct armguard_challenge {
    int64_t asked;
    uint8_t cookie[16];
};
struct armguard_welcome {
    uint32_t part, parts, joints, robots;
    double period;
    int64_t asked, received;
};
struct armguard_state {
    uint32_t robots, flags;
    double stamp;
};
struct armguard_wish {
    uint64_t token;
    uint32_t form, numbers;
};
struct armguard_command {
    uint64_t cycle, began_by, began_with;
    int64_t received, ended;
    double time, headroom, time_left;
    uint32_t body_a, body_b;
    double distance, pair_headroom, point_a[3], point_b[3];
    uint16_t reason, cause, level, action, flags, joints, robots, form;
    uint64_t commander;
};
struct armguard_robot {
    uint16_t level, action, blocked, stopped_by;
    float speed_scale, urgency;
    double age;
    uint64_t sender, sequence;
    double held_since;
};
struct armguard_claim {
    uint32_t force, reserved;
};
struct armguard_grant {
    uint32_t granted, reserved;
    uint64_t token, holder;
    double watchdog;
    uint64_t sequence;
};
/* For programs of sensors, which write these messages themselves: docs/service.md. */
struct armguard_frame {
    uint16_t sensor, part;
    uint8_t distances, has_status;
    uint16_t reserved;
    uint32_t number, size;
    double stamp;
};
struct armguard_health {
    double stamp;
    uint64_t taken, dropped;
    uint16_t port, first, rows, sensors;
};
struct armguard_sensor {
    uint32_t faults, frees;
    uint64_t taken, dropped;
    double stamp;
    uint8_t words[160];
};

struct armguard {
    uint32_t joints, robots;
    double period;                    /* of the service [s] */
    double home[ARMGUARD_JOINTS];     /* [rad or m] */
    double velocity[ARMGUARD_JOINTS]; /* what to send [rad/s or m/s], */
    double position[ARMGUARD_JOINTS]; /* the same as positions; NaN: nothing is to be sent */
    uint64_t cycle;
    uint16_t level, action, reason, cause; /* numbers as in docs/service.md */
    uint32_t held;                         /* robots that wait: bit k for robot k; send zero */
    uint16_t stopped_by[ARMGUARD_ROBOTS];  /* reason of each robot's last stop */
    double held_since[ARMGUARD_ROBOTS];    /* on CLOCK_MONOTONIC [s]; NaN: it does not wait */
    double distance, headroom; /* of the nearest pair [m] */
    int wire;
    struct armguard_header own;
    uint64_t token;
    char key[33];
    int reflex;              /* socket for the pulses of a reflex; -1 without one */
    char reflex_key[33];
    int64_t reflex_watchdog; /* [ns] */
    int64_t reflex_stamp;    /* of its newest pulse [ns] */
    uint16_t reflex_trip;    /* why it stops the arms; 0 if it does not */
    int reflex_stopped;      /* it did, and the guard need not be engaged yet */
    uint8_t out[ARMGUARD_MESSAGE], in[ARMGUARD_MESSAGE];
};

static inline int64_t armguard_clock(void) { /* the service's own clock [ns] */
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1000000000LL + now.tv_nsec;
}

static inline void armguard_say(struct armguard *guard, int kind, size_t size) {
    struct armguard_header *own = &guard->own; /* the payload is written already */
    size_t sealed = sizeof *own + size;
    own->kind = (uint8_t)kind, own->length = (uint16_t)(sealed + ARMGUARD_SEAL);
    own->sequence++, own->stamp = armguard_clock();
    memcpy(guard->out, own, sizeof *own);
    blake2s(guard->out + sealed, ARMGUARD_SEAL, guard->key, (int)strlen(guard->key),
            guard->out, sealed);
    if (send(guard->wire, guard->out, own->length, 0) < 0) return; /* then no answer comes */
}

/* Waits for a message of a kind until then [ns]; its payload's size, or -1. */
static inline long armguard_hear(struct armguard *guard, int kind, int64_t until) {
    for (;;) {
        struct pollfd wire = {guard->wire, POLLIN, 0};
        int64_t left = until - armguard_clock();
        if (left <= 0 || poll(&wire, 1, (int)((left + 999999) / 1000000)) == 0) return -1;
        uint8_t seal[ARMGUARD_SEAL];
        ssize_t size = recv(guard->wire, guard->in, ARMGUARD_MESSAGE, MSG_DONTWAIT);
        const long head = sizeof(struct armguard_header);
        if (size < head + ARMGUARD_SEAL || guard->in[5] != kind) continue;
        size -= ARMGUARD_SEAL;
        blake2s(seal, ARMGUARD_SEAL, guard->key, (int)strlen(guard->key), guard->in,
                (uint64_t)size);
        if (!memcmp(seal, guard->in + size, ARMGUARD_SEAL)) return size - head;
    }
}

/* Obeys a reflex of this machine, as its file says: one of the listeners, the key and the
 * watchdog [s]. Call it after armguard_open: from then on armguard_cycle stops the arms where
 * the reflex does or sends no pulses. 0, or -1 if the port is taken. */
static inline int armguard_obey(struct armguard *guard, int listener, const char *key,
                                double watchdog) {
    struct sockaddr_in at;
    memset(&at, 0, sizeof at);
    at.sin_family = AF_INET, at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    at.sin_port = htons((uint16_t)listener);
    guard->reflex = socket(AF_INET, SOCK_DGRAM, 0);
    snprintf(guard->reflex_key, sizeof guard->reflex_key, "%s", key);
    guard->reflex_watchdog = (int64_t)(watchdog * 1e9);
    if (guard->reflex < 0 || bind(guard->reflex, (struct sockaddr *)&at, sizeof at)) return -1;
    struct pollfd first = {guard->reflex, POLLIN, 0};
    poll(&first, 1, (int)(watchdog * 1e3)); /* one that runs is not silent at the start */
    return 0;
}

/* Why the reflex stops the arms: the cause; 0 if it does not. */
static inline uint16_t armguard_reflex(struct armguard *guard) {
    uint8_t pulse[64], seal[ARMGUARD_SEAL]; /* its fields are in docs/reflex.md */
    const uint8_t head[6] = {'A', 'G', 'R', 'X', 1, 0}; /* magic and version */
    int64_t stamp;
    if (guard->reflex < 0) return 0;
    const int now = MSG_DONTWAIT | MSG_TRUNC;
    for (ssize_t n; (n = recv(guard->reflex, pulse, sizeof pulse, now)) >= 0;) {
        if (n != (ssize_t)sizeof pulse || memcmp(pulse, head, sizeof head)) continue;
        memcpy(&stamp, pulse + 24, sizeof stamp);
        blake2s(seal, ARMGUARD_SEAL, guard->reflex_key, (int)strlen(guard->reflex_key),
                pulse, sizeof pulse - ARMGUARD_SEAL);
        if (memcmp(seal, pulse + 48, ARMGUARD_SEAL) || stamp <= guard->reflex_stamp) continue;
        guard->reflex_stamp = stamp;
        memcpy(&guard->reflex_trip, pulse + 6, sizeof guard->reflex_trip);
    }
    if (armguard_clock() - guard->reflex_stamp > guard->reflex_watchdog)
        return ARMGUARD_REFLEX_SILENT;
    return guard->reflex_trip ? ARMGUARD_REFLEX_STOPPED : 0;
}

static inline void armguard_close(struct armguard *guard) { /* says good-bye */
    if (guard->wire < 0) return;
    if (guard->reflex >= 0) close(guard->reflex);
    guard->reflex = -1;
    armguard_say(guard, ARMGUARD_BYE, 0);
    close(guard->wire);
    guard->wire = -1;
}

static inline int armguard_failed(struct armguard *guard, const char *sentence) {
    armguard_close(guard);
    fprintf(stderr, "armguard: %s\n", sentence);
    return -1;
}

/* Reads the key for 'command' from a file that only this user may read. 0 or -1. */
static inline int armguard_read_key(struct armguard *guard, const char *path) {
    char role[16];
    struct stat found;
    FILE *file = fopen(path, "r");
    if (!file) return -1;
    int own = !fstat(fileno(file), &found) && S_ISREG(found.st_mode) &&
              (found.st_uid == getuid() || found.st_uid == 0) && !(found.st_mode & 077);
    *guard->key = 0;
    while (own && fscanf(file, "%15s %32s", role, guard->key) == 2 && strcmp(role, "command"))
        *guard->key = 0;
    fclose(file);
    return strlen(guard->key) < 16 ? -1 : 0;
}

/* Connects to the service on a port of this machine. `keys` is its key file; if NULL the one
 * that ARMGUARD_KEYS names, else the one that a service of this user has written.
 * 0, or -1 and a sentence on stderr. */
static inline int armguard_open(struct armguard *guard, int port, const char *keys) {
    uint8_t *to = guard->out + sizeof(struct armguard_header);
    const uint8_t *payload = guard->in + sizeof(struct armguard_header);
    struct armguard_hello hello;
    struct armguard_challenge challenge;
    struct armguard_welcome welcome;
    char own[64];
    struct sockaddr_in at;
    int64_t start = armguard_clock(), until = start + 1000000000LL;
    memset(guard, 0, sizeof *guard), memset(&at, 0, sizeof at);
    memset(&hello, 0, sizeof hello);
    hello.role = 3; /* that of 'command'; it receives answers to its own states alone */
    at.sin_family = AF_INET, at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    at.sin_port = htons((uint16_t)port);
    guard->wire = guard->reflex = -1;
    snprintf(own, sizeof own, "/dev/shm/armguard-%u/%d.keys", (unsigned)getuid(), port);
    keys = keys ? keys : getenv("ARMGUARD_KEYS") ? getenv("ARMGUARD_KEYS") : own;
    if (armguard_read_key(guard, keys))
        return armguard_failed(guard, "no service of this user runs there, or its key file "
                                      "has no key for 'command' or is open to others");
    guard->wire = socket(AF_INET, SOCK_DGRAM, 0);
    if (guard->wire < 0 || connect(guard->wire, (struct sockaddr *)&at, sizeof at))
        return armguard_failed(guard, "there is no socket to be had");
    guard->own.magic = 0x44524741, guard->own.version = 3;
    guard->own.sender = (uint64_t)start ^ (uint64_t)getpid() << 40;
    memcpy(to, &hello, sizeof hello);
    armguard_say(guard, ARMGUARD_HELLO, sizeof hello);
    do { /* a cookie shows that this HELLO is no recording of an older one */
        if (armguard_hear(guard, ARMGUARD_CHALLENGE, until) < (long)sizeof challenge)
            return armguard_failed(guard, "no service answers");
        memcpy(&challenge, payload, sizeof challenge);
    } while (challenge.asked < start);
    memcpy(&guard->own.session, guard->in + 8, 16); /* session and scene */
    memcpy(hello.cookie, challenge.cookie, sizeof hello.cookie);
    memcpy(to, &hello, sizeof hello);
    armguard_say(guard, ARMGUARD_HELLO, sizeof hello);
    do { /* home is in the first part */
        if (armguard_hear(guard, ARMGUARD_WELCOME, until) < (long)sizeof welcome)
            return armguard_failed(guard, "no service answers");
        memcpy(&welcome, payload, sizeof welcome);
    } while (welcome.part != 0);
    memcpy(&guard->own.session, guard->in + 8, 16);
    guard->joints = welcome.joints, guard->robots = welcome.robots;
    guard->period = welcome.period;
    guard->in[ARMGUARD_MESSAGE - 1] = 0;
    char *text = strchr((char *)guard->in + sizeof guard->own + sizeof welcome, '[');
    if (guard->joints > ARMGUARD_JOINTS || guard->robots > ARMGUARD_ROBOTS || !text)
        return armguard_failed(guard, "more joints or robots than this header holds");
    for (uint32_t k = 0; k < guard->joints; k++) {
        guard->home[k] = strtod(text + 1, &text);
        guard->position[k] = NAN;
    }
    return 0;
}

/* Takes the command if no other client has it. 0, or -1 and a sentence on stderr. */
static inline int armguard_claim(struct armguard *guard) {
    struct armguard_claim claim = {0, 0};
    struct armguard_grant grant;
    memcpy(guard->out + sizeof guard->own, &claim, sizeof claim);
    armguard_say(guard, ARMGUARD_CLAIM, sizeof claim);
    if (armguard_hear(guard, ARMGUARD_GRANT, armguard_clock() + 1000000000LL) <
        (long)sizeof grant)
        return armguard_failed(guard, "no service answers");
    memcpy(&grant, guard->in + sizeof guard->own, sizeof grant);
    guard->token = grant.token;
    return grant.granted ? 0 : armguard_failed(guard, "another client has the command");
}

/* Sends positions of all joints, measured at `stamp` on CLOCK_MONOTONIC [s], velocities, or
 * NULL where they are not known, and desired velocities, or NULL. Receives the command. 1;
 * or 0 if that is not received in time: it is a stop then, velocities zero. */
static inline int armguard_cycle(struct armguard *guard, const double *q, const double *v,
                                 const double *desired, double stamp) {
    size_t row = 8 * (size_t)guard->joints;
    struct armguard_state state = {(1u << guard->robots) - 1,
                                   (v ? 1u : 0u) | (desired ? 2u : 0u), stamp};
    struct armguard_wish wish = {guard->token, 1, guard->joints};
    uint8_t *to = guard->out + sizeof guard->own, *start = to;
    memcpy(to, &state, sizeof state), to += sizeof state;
    memcpy(to, q, row), to += row;
    if (v) memcpy(to, v, row), to += row;
    if (desired) {
        memcpy(to, &wish, sizeof wish), to += sizeof wish;
        memcpy(to, desired, row), to += row;
    }
    armguard_say(guard, ARMGUARD_STATE, (size_t)(to - start));
    int64_t until = guard->own.stamp + (int64_t)(ARMGUARD_WATCHDOG * 1e9);
    const uint8_t *payload = guard->in + sizeof guard->own;
    struct armguard_command command;
    struct armguard_robot robot;
    size_t size = sizeof command + sizeof robot * guard->robots + 2 * row;
    for (long heard; (heard = armguard_hear(guard, ARMGUARD_COMMAND, until)) >= 0;) {
        if ((size_t)heard != size) continue;
        memcpy(&command, payload, sizeof command);
        if (command.began_by != guard->own.sender ||
            command.began_with != guard->own.sequence)
            continue; /* the answer to an older state is late */
        guard->cycle = command.cycle;
        guard->distance = command.distance, guard->headroom = command.headroom;
        guard->reason = command.reason, guard->cause = command.cause;
        guard->level = command.level, guard->action = command.action;
        guard->held = 0;
        for (uint32_t k = 0; k < guard->robots; k++) {
            memcpy(&robot, payload + sizeof command + k * sizeof robot, sizeof robot);
            guard->stopped_by[k] = robot.stopped_by;
            guard->held_since[k] = robot.held_since;
            if (!isnan(robot.held_since)) guard->held |= 1u << k;
        }
        memcpy(guard->velocity, payload + size - 2 * row, row);
        memcpy(guard->position, payload + size - row, row);
        uint16_t stop = armguard_reflex(guard);
        if (stop) {
            guard->reflex_stopped = stop;
        } else if (guard->reflex_stopped) { /* over when the guard has to be engaged too */
            int waits = command.cause == 10 || (command.cause >= 15 && command.cause <= 17);
            if (waits) guard->reflex_stopped = 0;
            else armguard_say(guard, ARMGUARD_ORDER_STOP, 0);
            stop = (uint16_t)guard->reflex_stopped;
        }
        if (stop) {
            memset(guard->velocity, 0, sizeof guard->velocity);
            guard->action = ARMGUARD_STOP, guard->cause = stop;
        }
        return 1;
    }
    memset(guard->velocity, 0, sizeof guard->velocity); /* positions stay the last ones */
    guard->action = ARMGUARD_STOP, guard->cause = 102, guard->held = 0;
    return 0;
}
#endif
