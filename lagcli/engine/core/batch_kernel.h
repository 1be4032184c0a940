/* All of the lanes for one instruction set: its file defines VEC_BYTES and NAME, and includes this. */
#include "control.h"
#include "dop853.h"
#include "dop853_tableau.h"
#include "batch_vector.h"
#include "method.h"
#include "motion.h"
#include "project.h"
#include "sizes.h"
#include "watch.h"

/* each needs those before it */
#include "batch_sincos.h"

#include "batch_tape.h"

#include "batch_solve.h"

#include "batch_project.h"

#include "batch_watch.h"

#include "batch_dop853.h"

#include "batch_sample.h"

#include "batch_sizes.h"

#include "batch_advance.h"

const lag_batch_kernel NAME = {batch_advance, batch_table, batch_sincos};
