/* Files by the name that importers give: UTF-8. */
#ifndef LAGCLI_FILE_H
#define LAGCLI_FILE_H

#include <stdio.h>

/* Open a file for reading; NULL if that fails. */
FILE *lag_open_file(const char *path);

#endif
