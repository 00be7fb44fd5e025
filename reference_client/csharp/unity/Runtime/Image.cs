// SPDX-License-Identifier: MIT
namespace SplatBus.Unity
{
    using UnityEngine;
    using Object = UnityEngine.Object;
    using Pose = SplatBus.Pose;

    /// <summary>The image that is shown: two textures, what their numbers mean, and the camera that it was rendered with.</summary>
    sealed class Image
    {
        static readonly int ColorId = Shader.PropertyToID("_SplatBusColor"), DepthId = Shader.PropertyToID("_SplatBusDepth"),
            LensId = Shader.PropertyToID("_SplatBusLens"), SizeId = Shader.PropertyToID("_SplatBusSize"),
            MeaningId = Shader.PropertyToID("_SplatBusMeaning"), SceneId = Shader.PropertyToID("_SplatBusScene");

        Texture2D color, depth;
        Semantics semantics;
        Pose wire;
        double fx, fy, cx, cy;
        float unit;
        bool hasDepth;

        internal bool IsThere { get; private set; }
        internal int Width { get { return IsThere ? color.width : 0; } }
        internal int Height { get { return IsThere ? color.height : 0; } }
        internal long Count { get; private set; }
        internal double TakenAt { get; private set; }
        internal string Problem { get; private set; }

        internal void Forget()
        {
            IsThere = false;
            Problem = null;
        }

        internal void Destroy()
        {
            Forget();
            Count = 0;
            if (color != null) Object.Destroy(color);
            if (depth != null) Object.Destroy(depth);
            color = depth = null;
        }

        /// <summary>Upload it, from where it lies; false if it is not to be shown.</summary>
        /// <param name="sceneUnit">Units of Unity to one of the scene.</param>
        internal bool Take(FrameLease lease, float sceneUnit, double now)
        {
            Meta meta = lease.Packet.Meta;
            if (!lease.HasColor) return false;
            if (meta.W > SystemInfo.maxTextureSize || meta.H > SystemInfo.maxTextureSize || lease.ColorBytes > int.MaxValue)
            {
                if (Problem == null) Problem = "an image of " + meta.W + " x " + meta.H + " is more than this GPU or Unity takes";
                return false;
            }
            Problem = null;
            Fit((int)meta.W, (int)meta.H);
            color.LoadRawTextureData(lease.ColorPointer, (int)lease.ColorBytes);
            if (lease.HasDepth) depth.LoadRawTextureData(lease.DepthPointer, (int)lease.DepthBytes);
            if (!lease.IsStillLent) return false; // the server may have written over it
            color.Apply(false, false);
            if (lease.HasDepth) depth.Apply(false, false);
            Keep(lease.Frame.Camera);
            semantics = lease.Packet.Semantics;
            hasDepth = lease.HasDepth;
            unit = sceneUnit;
            TakenAt = now;
            Count++;
            return IsThere = true;
        }

        /// <summary>What the shader has to know; see Pixel.hlsl.</summary>
        internal void Set(Material material, bool compareDepth)
        {
            bool isRay = semantics.Depth.Kind == DepthSemanticsKind.RayDistance, isPremultiplied = semantics.Alpha == SemanticsAlpha.Premultiplied;
            bool isSrgb = semantics.ColorSpace == SemanticsColorSpace.Srgb, isSrgbHere = QualitySettings.activeColorSpace == ColorSpace.Gamma;
            float empty = double.IsInfinity(semantics.Depth.Empty) ? 0 : (float)semantics.Depth.Empty; // neither is a surface
            material.SetTexture(ColorId, color);
            material.SetTexture(DepthId, depth);
            material.SetVector(LensId, new Vector4((float)fx, (float)fy, (float)cx, (float)cy));
            material.SetVector(SizeId, new Vector4(color.width, color.height, 0, 0));
            material.SetVector(MeaningId, new Vector4(isRay ? 1 : 0, isPremultiplied ? 1 : 0, isSrgb ? 1 : 0, empty));
            material.SetVector(SceneId, new Vector4(unit, compareDepth && hasDepth ? 1 : 0, isSrgbHere ? 1 : 0, 0));
        }

        /// <summary>Whether it was rendered from there; <paramref name="pose"/> in the axes of the wire.</summary>
        internal bool Shows(Pose pose) { return Axes.Alike(pose, wire); }

        /// <summary>As Camera.worldToCameraMatrix: x right, y up, the camera looking along -z.</summary>
        internal Matrix4x4 WorldToCamera()
        {
            Pose eye = UnityAxes.FromWire(wire);
            double x = eye.QX, y = eye.QY, z = eye.QZ, w = eye.QW, two = 2 / (x * x + y * y + z * z + w * w);
            // Rows of the inverse rotation: right, up and the direction of sight, in the world.
            double rx = 1 - two * (y * y + z * z), ry = two * (x * y + w * z), rz = two * (x * z - w * y);
            double ux = two * (x * y - w * z), uy = 1 - two * (x * x + z * z), uz = two * (y * z + w * x);
            double dx = two * (x * z + w * y), dy = two * (y * z - w * x), dz = 1 - two * (x * x + y * y);
            double px = eye.X * unit, py = eye.Y * unit, pz = eye.Z * unit;
            var matrix = new Matrix4x4();
            matrix.SetRow(0, new Vector4((float)rx, (float)ry, (float)rz, (float)-(rx * px + ry * py + rz * pz)));
            matrix.SetRow(1, new Vector4((float)ux, (float)uy, (float)uz, (float)-(ux * px + uy * py + uz * pz)));
            matrix.SetRow(2, new Vector4((float)-dx, (float)-dy, (float)-dz, (float)(dx * px + dy * py + dz * pz)));
            matrix.SetRow(3, new Vector4(0, 0, 0, 1));
            return matrix;
        }

        /// <summary>As Camera.projectionMatrix: the lens of the image between these planes, in units of Unity.</summary>
        internal Matrix4x4 Projection(float near, float far)
        {
            double width = color.width, height = color.height;
            var matrix = new Matrix4x4();
            matrix.SetRow(0, new Vector4((float)(2 * fx / width), 0, (float)(1 - 2 * cx / width), 0));
            matrix.SetRow(1, new Vector4(0, (float)(2 * fy / height), (float)(2 * cy / height - 1), 0));
            matrix.SetRow(2, new Vector4(0, 0, -(far + near) / (far - near), -2 * far * near / (far - near)));
            matrix.SetRow(3, new Vector4(0, 0, -1, 0));
            return matrix;
        }

        /// <summary>The numbers alone: the frame is used again for the next image.</summary>
        void Keep(FrameCamera camera)
        {
            wire = Pose.Of(camera.Position, camera.Rotation);
            fx = camera.Fx;
            fy = camera.Fy;
            cx = camera.Cx;
            cy = camera.Cy;
        }

        void Fit(int width, int height)
        {
            if (color != null && color.width == width && color.height == height) return;
            long count = Count;
            Destroy();
            Count = count;
            color = Plane(width, height, TextureFormat.RGBAFloat);
            depth = Plane(width, height, TextureFormat.RFloat);
        }

        /// <summary>Its first row is the bottom one, as in the memory of the server [BUF-1].</summary>
        static Texture2D Plane(int width, int height, TextureFormat format)
        {
            return new Texture2D(width, height, format, false, true)
            {
                filterMode = FilterMode.Point,
                wrapMode = TextureWrapMode.Clamp,
                hideFlags = HideFlags.HideAndDontSave,
            };
        }
    }
}
