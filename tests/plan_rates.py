"""Round costs, of no machine, for tests of `wall plan`."""

from wall.study.plan.rates import Rates

RATES = Rates(
    machine="test", commit="none", method="adaptive", cores=2, batch_samples=2048.0, batch_s=2e-3, aim_s=1e-3,
    replan_pixel_s=1e-7, sample_bytes=6.0, insert_s=5e-4, refresh_pixel_s=1e-7, framelet_pixel_bytes=1.5,
    pack_pixel_s=5e-9, unpack_pixel_s=2e-9, jpeg_pixel_bytes=0.25, jpeg_pixel_s=3e-9, h264_pixel_bytes=0.06,
    h264_pixel_s=2e-8, message_s=5e-5, event_send_s=1e-5, event_s=2e-5, packet_s=2e-5, turn_s=1e-4,
)  # fmt: skip
