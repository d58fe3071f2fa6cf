// Pi and infinity.
#ifndef KDRAY_CONSTANTS
#define KDRAY_CONSTANTS

#define INFINITY uintBitsToFloat(0x7f800000u)
const float PI = 3.14159265;

#endif
