// Random numbers of a path: Sobol points, scrambled by Owen's method. Twin of src/reference/sampler.rs.
//
// The numbers depend on nothing but the pixel of the whole picture, the index of the sample and the number's place in
// the path. So crops, tiles and batches get the same numbers as the whole picture. Numbers come in pairs. For each
// pair, the first 2^n samples of a pixel are spread evenly: every rectangle of area 2^-n, of any shape whose sides are
// powers of 1/2, has one of them.
//
// Each pair takes the first two dimensions of the Sobol sequence in an order of its own, which is shuffled and
// scrambled by hashes (Burley: Practical Hash-based Owen Scrambling, JCGT 2020; the hash of bits is by Vegdahl:
// Building a Better LK Hash, 2021). Needs nothing. Provides `SampleKey`, `sample_key` and `random_pair`.
#ifndef KDRAY_SAMPLER
#define KDRAY_SAMPLER

// What the random numbers of a path depend on.
struct SampleKey {
    // Hash of the pixel of the whole picture.
    uint pixel;
    // Index of the sample in its pixel.
    uint sample_ix;
};

// Mixes the bits of a number (Wellons: hash prospector, "lowbias32", 2018).
uint mixed(uint x) {
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    return x ^ (x >> 16);
}

// The key of a sample of a pixel of the whole picture.
SampleKey sample_key(uvec2 pixel, uint sample_ix) {
    return SampleKey(mixed(pixel.x ^ mixed(pixel.y + 0x9e3779b9u)), sample_ix);
}

// Flips each bit by a hash of the bits below it.
uint flipped_by_lower_bits(uint x, uint seed) {
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    return x ^ (x * 0x53a22864u);
}

// The second Sobol coordinate of a point of this index, with its bits reversed. Its digits are those of the index,
// times Pascal's triangle modulo 2.
uint second_coordinate_reversed(uint x) {
    x ^= (x >> 1) & 0x55555555u;
    x ^= (x >> 2) & 0x33333333u;
    x ^= (x >> 4) & 0x0f0f0f0fu;
    x ^= (x >> 8) & 0x00ff00ffu;
    return x ^ ((x >> 16) & 0x0000ffffu);
}

// The number in [0, 1) with these binary digits, the first of them in the highest bit.
float unit_number(uint digits) {
    return float(digits >> 8) * exp2(-24.0);
}

// The pair of random numbers at a place of the path, each in [0, 1).
vec2 random_pair(SampleKey key, uint place) {
    uint seed = mixed(key.pixel ^ mixed(place + 0x632be5abu));
    uint shuffled = bitfieldReverse(flipped_by_lower_bits(bitfieldReverse(key.sample_ix), seed));
    // The digits of the first coordinate are those of the index in reverse order.
    uint x = flipped_by_lower_bits(shuffled, mixed(seed ^ 0x68bc21ebu));
    uint y = flipped_by_lower_bits(second_coordinate_reversed(shuffled), mixed(seed ^ 0x02e5be93u));
    return vec2(unit_number(bitfieldReverse(x)), unit_number(bitfieldReverse(y)));
}

#endif
