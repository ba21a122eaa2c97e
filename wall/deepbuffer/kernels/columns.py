"""Names for the rows and columns of the arrays in `deepbuffer.store`: what kernels index them by."""

X, Y, Z = 0, 1, 2  # rows of SampleStore.position; X and Y also of SampleStore.screen_position
DEPTH = 2  # row of SampleStore.screen_position
SQRT_IRRADIANCE = 3  # column of SampleStore.radiance, after red, green and blue

NEAREST_DEPTH, NEAREST_X, NEAREST_Y, NEAREST_OBJECT = 0, 1, 2, 3  # columns of PixelHistory.nearest
IRRADIANCE, WEIGHT = 0, 1  # columns of PixelHistory.sqrt_irradiance: weighted sum, and sum of weights
AMOUNT, BEFORE = 0, 1  # columns of PixelHistory.rejection: share of confidence, time in seconds

# columns of PixelHistory.accumulation; deviations are sums of squares
RED, GREEN, BLUE = 0, 1, 2  # mean radiance
COUNT = 3  # samples
OBJECTS = 4  # whose samples these are, a bit each; exact, see accumulation.object_bit
LUMINANCE_DEVIATIONS = 5  # of luminance up to BRIGHTEST
IRRADIANCE_MEAN, IRRADIANCE_DEVIATIONS = 6, 7  # of the square root of irradiance
ACCUMULATION_COLUMNS = 8
DEVIATIONS = 3  # column of PixelHistory.light, after red, green and blue; a sum of squares too
