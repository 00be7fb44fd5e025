// SPDX-License-Identifier: MIT
namespace SplatBus.Unity
{
    using Camera = UnityEngine.Camera;

    /// <summary>The lens of a camera of Unity, the same object as long as its numbers are the same.</summary>
    sealed class LensOf
    {
        Intrinsics made;
        float fieldOfView, aspect, near, far, unit;
        int width, height;

        /// <summary>
        /// What the camera sees, in pixels of the server's images; these are not square where the images
        /// have not the shape of the camera's, and are stretched to it when they are drawn.
        /// </summary>
        internal Intrinsics Camera(Camera camera, int imageWidth, int imageHeight, float sceneUnit)
        {
            bool same = made != null && fieldOfView == camera.fieldOfView && aspect == camera.aspect && near == camera.nearClipPlane
                && far == camera.farClipPlane && width == imageWidth && height == imageHeight && unit == sceneUnit;
            if (same) return made;
            fieldOfView = camera.fieldOfView;
            aspect = camera.aspect;
            near = camera.nearClipPlane;
            far = camera.farClipPlane;
            width = imageWidth;
            height = imageHeight;
            unit = sceneUnit;
            made = Lenses.FromFieldOfView(fieldOfView, width, height, (double)near / unit, (double)far / unit);
            bool isSquare = System.Math.Abs(aspect * height - width) < 1;
            if (!isSquare) made.Fx = made.Fy * width / height / aspect;
            return made;
        }
    }
}
