/*
 * Radau IIA of order 5: E. Hairer & G. Wanner, Solving Ordinary Differential Equations II,
 * IV.5 and IV.8. The inverse of the method's matrix A is T diag(real, [[re, -im], [im, re]]) T^-1.
 */
#ifndef LAGCLI_RADAU5_TABLEAU_H
#define LAGCLI_RADAU5_TABLEAU_H

/* (4 -+ sqrt 6)/10, 1 */
static const double radau_c[3] = {0.15505102572168220, 0.64494897427831781, 1.0};

static const double radau_t[3][3] = {
    {0.091232394870892942792, -0.14125529502095420843, -0.030029194105147424492},
    {0.24171793270710701896, 0.20412935229379993199, 0.38294211275726193779},
    {0.96604818261509293619, 1.0, 0.0}};

static const double radau_t_inverse[3][3] = {
    {4.3255798900631553510, 0.33919925181580986954, 0.54177053993587487119},
    {-4.1787185915519047273, -0.32768282076106238708, 0.47662355450055045196},
    {-0.50287263494578687595, 2.5719269498556054292, -0.59603920482822492497}};

/* the eigenvalues of A^-1 */
static const double radau_real = 3.6378342527444957322;
static const double radau_re = 2.6810828736277521339;
static const double radau_im = 3.0504301992474105694;

/* the error's weights of z_1, z_2, z_3: those of an embedded formula of order 3, times real */
static const double radau_error[3] = {
    -10.048809399827415562, 1.3821427331607488958, -0.33333333333333333333};

/*
 * The integral of the defect -(x - c_1)(x - c_2)(x - 1) / (c_1 c_2) from 0, times real, is
 * radau_defect x (x - 1)^2 (x - radau_zero): zero at the end, where the quadrature is exact.
 */
static const double radau_defect = -9.0945856318612393304;
static const double radau_zero = 0.4;

#endif
