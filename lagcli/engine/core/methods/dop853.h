/* Dormand and Prince's explicit method of order 8(5, 3), with dense output of order 7. */
#ifndef LAGCLI_DOP853_H
#define LAGCLI_DOP853_H

#define STABLE 6.1          /* h times the dominant eigenvalue at the boundary of the stability region */
#define NOT_STIFF 6         /* steps inside it after which the count restarts */
#define STIFF 15            /* steps limited by stability after which the model counts as stiff */
#define FLAT 30.0           /* the error estimate of third order over that of fifth: smooth motion has more */
#define SEEN 1e-4           /* of the tolerance: an error that keeps the next step from growing as it may */
#define NOTABLE 0.01        /* of the tolerance: an error that limits the step */

#endif
