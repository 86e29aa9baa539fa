#include "skeleton/skeleton.h"
