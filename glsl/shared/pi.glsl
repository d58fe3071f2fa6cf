// The number pi.
#ifndef KDRAY_PI
#define KDRAY_PI

const float PI = 3.14159265;

#endif
