/* A client of `armguard serve` in one header, for loops in C and C++ on the machine of the
 * service: tells what all joints measure and what is wanted of them, waits for what the
 * robots are to be told, and says stop when that does not come in time.
 *
 *     struct armguard guard;
 *     armguard_open(&guard, 47800, NULL);          // 0, or a sentence is on stderr
 *     armguard_claim(&guard);                      // to command; not to send states
 *     for (;;) {
 *         // a robot that was stopped waits until zero is asked for once, or it is engaged
 *         armguard_cycle(&guard, q, v, guard.held ? zero : wish, stamp); // 0: it is silent
 *         send_to_robots(guard.velocity);          // always, also while they stop
 *     }
 *
 * No threads, nothing allocated. Bytes and offsets are told in docs/service.md. */
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
enum { ARMGUARD_JOINTS = 64, ARMGUARD_MESSAGE = 8192, ARMGUARD_HEAD = 48, ARMGUARD_SEAL = 16 };
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

struct armguard_head {
    uint32_t magic;
    uint8_t version, kind;
    uint16_t length;
    uint64_t session, scene, sender, sequence;
    int64_t stamp;
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
    double clearance, room; /* of the nearest pair, and what is left of it beyond its need [m] */
    int wire;
    struct armguard_head own;
    uint64_t token;
    char key[33];
    uint8_t out[ARMGUARD_MESSAGE], in[ARMGUARD_MESSAGE];
};

static inline int64_t armguard_clock(void) { /* the service's own clock [ns] */
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1000000000LL + now.tv_nsec;
}

static inline void armguard_say(struct armguard *guard, int kind, size_t size) {
    struct armguard_head *own = &guard->own; /* the payload is written already */
    size_t sealed = ARMGUARD_HEAD + size;
    own->kind = (uint8_t)kind, own->length = (uint16_t)(sealed + ARMGUARD_SEAL);
    own->sequence++, own->stamp = armguard_clock();
    memcpy(guard->out, own, ARMGUARD_HEAD);
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
        if (size < ARMGUARD_HEAD + ARMGUARD_SEAL || guard->in[5] != kind) continue;
        size -= ARMGUARD_SEAL;
        blake2s(seal, ARMGUARD_SEAL, guard->key, (int)strlen(guard->key), guard->in,
                (uint64_t)size);
        if (!memcmp(seal, guard->in + size, ARMGUARD_SEAL)) return size - ARMGUARD_HEAD;
    }
}

static inline void armguard_close(struct armguard *guard) { /* says good-bye */
    if (guard->wire < 0) return;
    armguard_say(guard, 13, 0);
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
    uint8_t *to = guard->out + ARMGUARD_HEAD;
    const uint8_t *told = guard->in + ARMGUARD_HEAD;
    /* Its key is for 'command'; it receives answers to its own states alone. */
    const uint32_t hello[2] = {3, 0};
    char own[64];
    struct sockaddr_in at;
    int64_t asked, start = armguard_clock(), until = start + 1000000000LL;
    uint32_t part;
    memset(guard, 0, sizeof *guard), memset(&at, 0, sizeof at);
    at.sin_family = AF_INET, at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    at.sin_port = htons((uint16_t)port);
    guard->wire = -1;
    snprintf(own, sizeof own, "/dev/shm/armguard-%u/%d.keys", (unsigned)getuid(), port);
    keys = keys ? keys : getenv("ARMGUARD_KEYS") ? getenv("ARMGUARD_KEYS") : own;
    if (armguard_read_key(guard, keys))
        return armguard_failed(guard, "no service of this user runs there, or its key file "
                                      "has no key for 'command' or is open to others");
    guard->wire = socket(AF_INET, SOCK_DGRAM, 0);
    if (guard->wire < 0 || connect(guard->wire, (struct sockaddr *)&at, sizeof at))
        return armguard_failed(guard, "there is no socket to be had");
    guard->own.magic = 0x44524741, guard->own.version = 2;
    guard->own.sender = (uint64_t)start ^ (uint64_t)getpid() << 40;
    memcpy(to, hello, 8), memset(to + 8, 0, 16);
    armguard_say(guard, 1, 24);
    do { /* a cookie shows that this HELLO is no recording of an older one */
        if (armguard_hear(guard, 14, until) < 24)
            return armguard_failed(guard, "no service answers");
        memcpy(&asked, told, 8);
    } while (asked < start);
    memcpy(&guard->own.session, guard->in + 8, 16);
    memcpy(to, hello, 8), memcpy(to + 8, told + 8, 16);
    armguard_say(guard, 1, 24);
    do { /* home is in the first part */
        if (armguard_hear(guard, 2, until) < 40)
            return armguard_failed(guard, "no service answers");
        memcpy(&part, told, 4);
    } while (part != 0);
    memcpy(&guard->own.session, guard->in + 8, 16);
    memcpy(&guard->joints, told + 8, 4), memcpy(&guard->robots, told + 12, 4);
    memcpy(&guard->period, told + 16, 8);
    guard->in[ARMGUARD_MESSAGE - 1] = 0;
    char *text = strchr((char *)told + 40, '[');
    if (guard->joints > ARMGUARD_JOINTS || guard->robots > ARMGUARD_ROBOTS || !text)
        return armguard_failed(guard, "more joints or robots than this header holds");
    for (uint32_t k = 0; k < guard->joints; k++) {
        guard->home[k] = strtod(text + 1, &text);
        guard->position[k] = NAN;
    }
    return 0;
}

/* Takes the command if nobody has it. 0, or -1 and a sentence on stderr. */
static inline int armguard_claim(struct armguard *guard) {
    const uint8_t *told = guard->in + ARMGUARD_HEAD;
    uint32_t granted = 0;
    memset(guard->out + ARMGUARD_HEAD, 0, 8);
    armguard_say(guard, 7, 8);
    if (armguard_hear(guard, 8, armguard_clock() + 1000000000LL) < 40)
        return armguard_failed(guard, "no service answers");
    memcpy(&granted, told, 4), memcpy(&guard->token, told + 8, 8);
    return granted ? 0 : armguard_failed(guard, "somebody else commands");
}

/* Tells what all joints measured at `stamp` on CLOCK_MONOTONIC [s], their velocities, or
 * NULL where they are not known, and the velocities that are wanted, or NULL. Takes in what
 * is to be told. 1; or 0 if that does not come in time: it is a stop then, velocities zero. */
static inline int armguard_cycle(struct armguard *guard, const double *q, const double *v,
                                 const double *wish, double stamp) {
    size_t row = 8 * (size_t)guard->joints;
    uint32_t of[2] = {(1u << guard->robots) - 1, (v ? 1u : 0u) | (wish ? 2u : 0u)};
    uint32_t form[2] = {1, guard->joints};
    uint8_t *to = guard->out + ARMGUARD_HEAD;
    memcpy(to, of, 8), memcpy(to + 8, &stamp, 8), memcpy(to + 16, q, row), to += 16 + row;
    if (v) memcpy(to, v, row), to += row;
    if (wish) {
        memcpy(to, &guard->token, 8), memcpy(to + 8, form, 8);
        memcpy(to + 16, wish, row), to += 16 + row;
    }
    armguard_say(guard, 3, (size_t)(to - guard->out) - ARMGUARD_HEAD);
    int64_t until = guard->own.stamp + (int64_t)(ARMGUARD_WATCHDOG * 1e9);
    const uint8_t *told = guard->in + ARMGUARD_HEAD;
    size_t size = 160 + 48 * (size_t)guard->robots + 2 * row;
    for (long heard; (heard = armguard_hear(guard, 5, until)) >= 0;) {
        uint64_t answered[2]; /* to whom, and to which of his states */
        memcpy(answered, told + 8, 16);
        if ((size_t)heard != size || answered[0] != guard->own.sender ||
            answered[1] != guard->own.sequence)
            continue; /* what answers an older state is late */
        memcpy(&guard->cycle, told, 8);
        memcpy(&guard->clearance, told + 72, 8), memcpy(&guard->room, told + 80, 8);
        memcpy(&guard->reason, told + 136, 2), memcpy(&guard->cause, told + 138, 2);
        memcpy(&guard->level, told + 140, 2), memcpy(&guard->action, told + 142, 2);
        guard->held = 0;
        for (uint32_t k = 0; k < guard->robots; k++) {
            const uint8_t *own = told + 160 + 48 * (size_t)k;
            memcpy(&guard->stopped_by[k], own + 6, 2);
            memcpy(&guard->held_since[k], own + 40, 8);
            if (!isnan(guard->held_since[k])) guard->held |= 1u << k;
        }
        memcpy(guard->velocity, told + size - 2 * row, row);
        memcpy(guard->position, told + size - row, row);
        return 1;
    }
    memset(guard->velocity, 0, sizeof guard->velocity); /* positions stay those told last */
    guard->action = ARMGUARD_STOP, guard->cause = 102, guard->held = 0;
    return 0;
}
#endif
