/* A controller and commander in C whose arms do at once what they are told.
 *     cc -O2 -o client client.c && ./client 47800 2 */
#include "armguard.h"

int main(int argc, char **argv) {
    static struct armguard guard;
    double q[ARMGUARD_JOINTS], v[ARMGUARD_JOINTS] = {0}, wish[ARMGUARD_JOINTS];
    double seconds = argc > 2 ? atof(argv[2]) : 2.0;
    if (armguard_open(&guard, argc > 1 ? atoi(argv[1]) : 47800, NULL)) return 2;
    if (armguard_claim(&guard)) return 2;
    for (uint32_t j = 0; j < guard.joints; j++) q[j] = guard.home[j], wish[j] = 0.05;
    for (int k = 0, cycles = (int)(seconds / guard.period); k < cycles; k++) {
        double stamp = (double)armguard_clock() * 1e-9;
        if (!armguard_cycle(&guard, q, v, wish, stamp)) {
            fprintf(stderr, "the service is silent: stop\n");
            return 1;
        }
        for (uint32_t j = 0; j < guard.joints; j++)
            q[j] += (v[j] = guard.velocity[j]) * guard.period;
        if (k % 50 == 0 || k == cycles - 1)
            printf("cycle %llu level %u action %u reason %u cause %u v %.4f\n",
                   (unsigned long long)guard.cycle, guard.level, guard.action, guard.reason,
                   guard.cause, v[0]);
        struct timespec rest = {0, (long)(guard.period * 9e8)};
        nanosleep(&rest, NULL);
    }
    armguard_close(&guard);
    return 0;
}
