/* Keyed BLAKE2s (RFC 7693) of a message in one piece; little-endian machines. */
#ifndef BLAKE2S_H
#define BLAKE2S_H
#include <stdint.h>
#include <string.h>

static uint32_t blake2s_turn(uint32_t word, int by) {
    return (word >> by) | (word << (32 - by));
}

static void blake2s_block(uint32_t h[8], const uint8_t block[64], uint64_t count, int last) {
    static const uint32_t start[8] = {
        0x6A09E667, 0xBB67AE85, 0x3C6EF372, 0xA54FF53A,
        0x510E527F, 0x9B05688C, 0x1F83D9AB, 0x5BE0CD19};
    static const uint8_t order[10][16] = {
        {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15},
        {14, 10, 4, 8, 9, 15, 13, 6, 1, 12, 0, 2, 11, 7, 5, 3},
        {11, 8, 12, 0, 5, 2, 15, 13, 10, 14, 3, 6, 7, 1, 9, 4},
        {7, 9, 3, 1, 13, 12, 11, 14, 2, 6, 5, 10, 4, 0, 15, 8},
        {9, 0, 5, 7, 2, 4, 10, 15, 14, 1, 11, 12, 6, 8, 3, 13},
        {2, 12, 6, 10, 0, 11, 8, 3, 4, 13, 7, 5, 15, 14, 1, 9},
        {12, 5, 1, 15, 14, 13, 4, 10, 0, 7, 6, 3, 9, 2, 8, 11},
        {13, 11, 7, 14, 12, 1, 3, 9, 5, 0, 15, 4, 8, 6, 2, 10},
        {6, 15, 14, 9, 11, 3, 0, 8, 12, 2, 13, 7, 1, 4, 10, 5},
        {10, 2, 8, 4, 7, 6, 1, 5, 15, 11, 9, 14, 3, 12, 13, 0}};
    static const uint8_t mixed[8][4] = {
        {0, 4, 8, 12}, {1, 5, 9, 13}, {2, 6, 10, 14}, {3, 7, 11, 15},
        {0, 5, 10, 15}, {1, 6, 11, 12}, {2, 7, 8, 13}, {3, 4, 9, 14}};
    uint32_t v[16], m[16];
    memcpy(m, block, 64);
    memcpy(v, h, 32);
    memcpy(v + 8, start, 32);
    v[12] ^= (uint32_t)count;
    v[13] ^= (uint32_t)(count >> 32);
    if (last) v[14] = ~v[14];
    for (int round = 0; round < 10; round++)
        for (int k = 0; k < 8; k++) {
            uint32_t *a = v + mixed[k][0], *b = v + mixed[k][1];
            uint32_t *c = v + mixed[k][2], *d = v + mixed[k][3];
            *a += *b + m[order[round][2 * k]];
            *d = blake2s_turn(*d ^ *a, 16);
            *c += *d;
            *b = blake2s_turn(*b ^ *c, 12);
            *a += *b + m[order[round][2 * k + 1]];
            *d = blake2s_turn(*d ^ *a, 8);
            *c += *d;
            *b = blake2s_turn(*b ^ *c, 7);
        }
    for (int k = 0; k < 8; k++) h[k] ^= v[k] ^ v[k + 8];
}

/* Writes `size` bytes of digest; the key has 1 to 32 bytes. */
static void blake2s(uint8_t *digest, int size, const void *key, int key_size,
                    const uint8_t *data, uint64_t length) {
    uint32_t h[8] = {0x6A09E667, 0xBB67AE85, 0x3C6EF372, 0xA54FF53A,
                     0x510E527F, 0x9B05688C, 0x1F83D9AB, 0x5BE0CD19};
    uint8_t block[64] = {0};
    uint64_t done = 64;
    h[0] ^= 0x01010000u ^ ((uint32_t)key_size << 8) ^ (uint32_t)size;
    memcpy(block, key, (size_t)key_size);
    blake2s_block(h, block, 64, length == 0);
    while (length > 64) {
        done += 64;
        blake2s_block(h, data, done, 0);
        data += 64;
        length -= 64;
    }
    if (length) {
        memset(block, 0, 64);
        memcpy(block, data, length);
        blake2s_block(h, block, done + length, 1);
    }
    memcpy(digest, h, (size_t)size);
}
#endif
