#include "fmi/file.h"

#ifdef _WIN32
#include <windows.h>

#define LONGEST_PATH 4096

FILE *lag_open_file(const char *path)
{
    wchar_t wide[LONGEST_PATH];
    return MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, LONGEST_PATH) ? _wfopen(wide, L"rb") : NULL;
}
#else
FILE *lag_open_file(const char *path)
{
    return fopen(path, "rb");
}
#endif
