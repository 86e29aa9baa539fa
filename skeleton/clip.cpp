#include "skeleton/clip.h"
