/* A controller and commander in C: sends states and wishes to `armguard serve`, prints
 * what the robots are told. Its arms do at once what they are told.
 *
 *     cc -O2 -o client client.c && ./client 47800 2
 *
 * Bytes and offsets are told in docs/service.md. */
#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>
#include "blake2s.h"

enum { HELLO = 1, WELCOME = 2, STATE = 3, COMMAND = 5, CLAIM = 7, GRANT = 8, BYE = 13 };
enum { HEAD = 48, SEAL = 16, MOST = 8192, ROBOT = 40, JOINTS = 64 };
struct head {
    uint32_t magic;
    uint8_t version, kind;
    uint16_t length;
    uint64_t session, scene, sender, sequence;
    int64_t stamp;
};
static struct head own = {.magic = 0x44524741, .version = 1};
static _Alignas(8) uint8_t out[MOST], in[MOST];
static int wire;

static int64_t clock_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1000000000LL + now.tv_nsec;
}

static void say(int kind, int size) { /* what was written behind the header */
    own.kind = (uint8_t)kind, own.length = (uint16_t)(HEAD + size + SEAL);
    own.sequence++, own.stamp = clock_ns();
    memcpy(out, &own, HEAD);
    blake2s(out + HEAD + size, SEAL, "armguard", 8, out, (uint64_t)(HEAD + size));
    send(wire, out, own.length, 0);
}

static int hear(int kind) { /* the next message of that kind, or 0 after 1 s */
    for (int64_t end = clock_ns() + 1000000000LL; clock_ns() < end;) {
        ssize_t size = recv(wire, in, MOST, 0);
        uint8_t seal[SEAL];
        if (size < HEAD + SEAL || in[5] != kind) continue;
        blake2s(seal, SEAL, "armguard", 8, in, (uint64_t)(size - SEAL));
        if (!memcmp(seal, in + size - SEAL, SEAL)) return 1;
    }
    return 0;
}

int main(int argc, char **argv) {
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    struct timeval second = {.tv_sec = 1};
    uint32_t joints, robots, hello[2] = {0, 1}, claim[2] = {0, 0};
    uint64_t token;
    double period, q[JOINTS], v[JOINTS] = {0}, wish = 0.05;
    at.sin_port = htons((uint16_t)atoi(argc > 1 ? argv[1] : "47800"));
    wire = socket(AF_INET, SOCK_DGRAM, 0);
    setsockopt(wire, SOL_SOCKET, SO_RCVTIMEO, &second, sizeof second);
    if (connect(wire, (struct sockaddr *)&at, sizeof at)) return perror("connect"), 2;
    own.sender = (uint64_t)clock_ns() ^ (uint64_t)getpid() << 40;

    memcpy(out + HEAD, hello, 8);
    say(HELLO, 8);
    do if (!hear(WELCOME)) return fprintf(stderr, "no service answers\n"), 2;
    while (*(uint32_t *)(in + HEAD) != 0); /* home is in the first part */
    memcpy(&own.session, in + 8, 16);
    memcpy(&joints, in + HEAD + 8, 4), memcpy(&robots, in + HEAD + 12, 4);
    memcpy(&period, in + HEAD + 16, 8);
    char *text = strchr((char *)in + HEAD + 40, '[');
    if (joints > JOINTS || !text) return fprintf(stderr, "too many joints\n"), 2;
    for (uint32_t k = 0; k < joints; k++) q[k] = strtod(text + 1, &text);

    memcpy(out + HEAD, claim, 8);
    say(CLAIM, 8);
    if (!hear(GRANT) || !in[HEAD]) return fprintf(stderr, "somebody else commands\n"), 2;
    memcpy(&token, in + HEAD + 8, 8);

    int cycles = (int)((argc > 2 ? atof(argv[2]) : 2.0) / period);
    for (int k = 0; k < cycles; k++) {
        uint32_t state[2] = {(1u << robots) - 1, 3}, form[2] = {1, joints};
        double stamp = (double)clock_ns() * 1e-9;
        uint8_t *to = out + HEAD;
        memcpy(to, state, 8), memcpy(to + 8, &stamp, 8), to += 16;
        memcpy(to, q, 8 * joints), to += 8 * joints; /* positions, velocities, */
        memcpy(to, v, 8 * joints), to += 8 * joints;
        memcpy(to, &token, 8), memcpy(to + 8, form, 8), to += 16; /* and a wish */
        for (uint32_t j = 0; j < joints; j++, to += 8) memcpy(to, &wish, 8);
        say(STATE, (int)(to - out) - HEAD);
        if (!hear(COMMAND)) return fprintf(stderr, "the service is silent: stop\n"), 1;
        const uint16_t *told = (const uint16_t *)(in + HEAD + 136);
        memcpy(v, in + HEAD + 160 + ROBOT * robots, 8 * joints);
        for (uint32_t j = 0; j < joints; j++) q[j] += v[j] * period;
        if (k % 50 == 0 || k == cycles - 1)
            printf("cycle %llu level %d action %d reason %d cause %d v %.4f\n",
                   (unsigned long long)*(uint64_t *)(in + HEAD), told[2], told[3],
                   told[0], told[1], v[0]);
        struct timespec rest = {0, (long)(period * 9e8)};
        nanosleep(&rest, NULL);
    }
    say(BYE, 0);
    return 0;
}
