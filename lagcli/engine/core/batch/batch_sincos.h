/*
 * sin and cos of a vector: reduction by multiples of pi/2 in four parts (Cody and Waite), then the
 * polynomials of fdlibm on [-pi/4, pi/4]. Error below one unit in the last place; larger numbers are
 * left to the C library, one by one.
 *
 * The coefficients are those of fdlibm: "Copyright (C) 1993 by Sun Microsystems, Inc. All rights
 * reserved. Permission to use, copy, modify, and distribute this software is freely granted, provided
 * that this notice is preserved."
 */

#define SINCOS_LARGEST 1e5 /* up to here, multiples of pi/2 times its parts are exact */

INLINE void vec_sincos(vec x, vec *sine, vec *cosine)
{
    const double round = 6755399441055744.0; /* 1.5 * 2^52: adding it rounds to an integer */
    const vec shifted = x * 0.6366197723675814 + round;
    const vec n = shifted - round;
    /* pi/2: three parts of 33 bits and a remainder */
    const vec a = x - n * 1.57079632673412561417e+00; /* exact */
    const vec second = n * 6.07710050630396597660e-11;
    const vec b = a - second;
    const vec b_back = b - a;
    const vec b_rest = (a - (b - b_back)) - (second + b_back);
    const vec third = n * 2.02226624871116645580e-21;
    const vec c = b - third;
    const vec c_back = c - b;
    const vec c_rest = (b - (c - c_back)) - (third + c_back);
    const vec rest = (b_rest + c_rest) - n * 8.47842766036889956997e-32;
    const vec y = c + rest;
    const vec low = (c - y) + rest;

    const vec z = y * y, w = z * z, half = 0.5 * z, v = z * y;
    const vec s = 8.33333333332248946124e-03
                  + z * (-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06)
                  + z * w * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10);
    const vec sin_y = y - ((z * (0.5 * low - v * s) - low) + v * 1.66666666666666324348e-01);
    const vec r = z * (4.16666666666666019037e-02
                       + z * (-1.38888888888741095749e-03 + z * 2.48015872894767294178e-05))
                  + w * w * (-2.75573143513906633035e-07
                             + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11));
    const vec one = 1.0 - half;
    const vec cos_y = one + (((1.0 - one) - half) + (z * r - y * low));

    const mask quadrant = (mask)shifted;
    const mask swapped = -(quadrant & 1);
    const mask sign = (quadrant & 2) << 62, cosine_sign = ((quadrant + 1) & 2) << 62;
    *sine = (vec)((mask)choose(swapped, cos_y, sin_y) ^ sign);
    *cosine = (vec)((mask)choose(swapped, sin_y, cos_y) ^ cosine_sign);
    if (any(magnitude(x) > SINCOS_LARGEST))
        for (int i = 0; i < VEC; ++i)
            if (fabs(x[i]) > SINCOS_LARGEST) {
                (*sine)[i] = sin(x[i]);
                (*cosine)[i] = cos(x[i]);
            }
}
