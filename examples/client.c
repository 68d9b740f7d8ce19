/* A controller and commander in C, with simulated arms that follow at once. After a stop it
 * sends zero velocity until no robot is held; a stop that was ordered needs `engage`.
 *     cc -O2 -o client client.c && ./client 47800 2
 * With a port and the key of a reflex as well it obeys that: ./client 47800 2 47813 KEY */
#include "armguard.h"

/* Go on with velocities since a time; the time now. */
static double go_on(double *q, const double *v, uint32_t joints, double since) {
    double now = (double)armguard_clock() * 1e-9;
    for (uint32_t j = 0; j < joints; j++) q[j] += v[j] * (now - since);
    return now;
}

int main(int argc, char **argv) {
    static struct armguard guard;
    static const double zero[ARMGUARD_JOINTS] = {0};
    double q[ARMGUARD_JOINTS], v[ARMGUARD_JOINTS] = {0}, desired[ARMGUARD_JOINTS];
    double seconds = argc > 2 ? atof(argv[2]) : 2.0;
    int silent = 0;
    if (armguard_open(&guard, argc > 1 ? atoi(argv[1]) : 47800, NULL)) return 2;
    if (argc > 4 && armguard_obey(&guard, atoi(argv[3]), argv[4], 0.1)) return 2;
    if (armguard_claim(&guard)) return 2;
    for (uint32_t j = 0; j < guard.joints; j++) q[j] = guard.home[j], desired[j] = 0.05;
    double stamp = (double)armguard_clock() * 1e-9;
    for (int k = 0, cycles = (int)(seconds / guard.period); k < cycles; k++) {
        stamp = go_on(q, v, guard.joints, stamp); /* positions belong to a time */
        silent = armguard_cycle(&guard, q, v, guard.held ? zero : desired, stamp) ? 0 : silent + 1;
        if (silent * ARMGUARD_WATCHDOG > 1.0) {
            fprintf(stderr, "the service is silent: stop\n");
            return 1;
        }
        stamp = go_on(q, v, guard.joints, stamp); /* until the answer came */
        for (uint32_t j = 0; j < guard.joints; j++) v[j] = guard.velocity[j];
        if (k % 50 == 0 || k == cycles - 1)
            printf("cycle %llu level %u action %u reason %u cause %u held %u v %.4f\n",
                   (unsigned long long)guard.cycle, guard.level, guard.action, guard.reason,
                   guard.cause, guard.held, v[0]);
        struct timespec rest = {0, (long)(guard.period * 9e8)};
        nanosleep(&rest, NULL);
    }
    armguard_close(&guard);
    return 0;
}
