// Random numbers from whole numbers (the finaliser of MurmurHash3, Appleby 2011).

uint hash(uint x) {
    x ^= x >> 16;
    x *= 0x85ebca6bu;
    x ^= x >> 13;
    x *= 0xc2b2ae35u;
    return x ^ x >> 16;
}

uint hash(ivec2 place, uint seed) {
    return hash(uint(place.x) + hash(uint(place.y) + hash(seed)));
}

// In [0, 1).
float unit(uint x) {
    return float(x >> 8) * (1.0 / 16777216.0);
}
