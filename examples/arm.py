"""The torques that hold a PUMA 560 still at several shoulder angles, by mp2a and by pinocchio."""

import numpy as np

import mp2a

quarter = np.pi / 2
arm = mp2a.Model.from_dh(
    [
        [0.0, quarter, 0.0, 0.0],
        [0.4318, 0.0, 0.0, 0.0],
        [0.0203, -quarter, 0.15005, 0.0],
        [0.0, quarter, 0.4318, 0.0],
        [0.0, -quarter, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0],
    ],
    masses=[0.0, 17.4, 4.8, 0.82, 0.34, 0.09],
    coms=[
        [0, 0, 0],
        [-0.3638, 0.006, 0.2275],
        [-0.0203, -0.0141, 0.07],
        [0, 0.019, 0],
        [0, 0, 0],
        [0, 0, 0.032],
    ],
)  # Corke and Armstrong-Hélouvry (1994)

angles = np.linspace(0, quarter, 7)
q = np.zeros((len(angles), 6))
q[:, 1] = angles
still = np.zeros_like(q)
torque = mp2a.rnea(arm, q, still, still)
reference = mp2a.Reference(arm).rnea(q, still, still).torque
for angle, ours in zip(angles, torque, strict=True):
    bar = "█" * round(abs(ours[1]) / 2)
    print(f"shoulder at {np.degrees(angle):4.0f}°: {ours[1]:7.2f} N m {bar}")
print(f"largest difference from pinocchio {abs(torque - reference).max():.1e} N m")
