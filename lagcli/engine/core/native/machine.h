/* The machines that code is emitted for. */
#ifndef LAGCLI_NATIVE_MACHINE_H
#define LAGCLI_NATIVE_MACHINE_H

#if defined(__x86_64__)
#define LAG_MACHINE
#endif

#endif
