// SPDX-License-Identifier: MIT
//
// A stub of UnityEngine, written for these tests by the authors of SplatBus: the names and types that
// the package in reference_client/csharp uses, as Unity's manual tells of them. No code of Unity's is in
// it, and none was looked at. It lets a compiler check names and types; textures, materials and cameras
// keep what they are given, for Driver.cs to tell of. It shows nothing of what Unity does with it.
using System;
using System.Collections.Generic;
using System.Runtime.InteropServices;

namespace UnityEngine
{
    public class Object
    {
        public HideFlags hideFlags { get; set; }
        internal bool IsDestroyed;
        public static void Destroy(Object one) { one.IsDestroyed = true; }
    }

    public class Component : Object
    {
        /// <summary>Of the stub: what is on the same object.</summary>
        internal List<Component> Beside = new List<Component>();
        public Transform transform { get { return GetComponent<Transform>(); } }

        public T GetComponent<T>() where T : class
        {
            foreach (Component each in Beside) if (each is T) return each as T;
            return null;
        }

        public bool TryGetComponent<T>(out T found) where T : class { return (found = GetComponent<T>()) != null; }
    }

    public class Behaviour : Component
    {
        public bool isActiveAndEnabled { get { return true; } }
    }

    public class MonoBehaviour : Behaviour { }
    public class ScriptableObject : Object { }

    public class Transform : Component
    {
        public Vector3 position { get; set; }
        public Quaternion rotation { get; set; }
        public Vector3 lossyScale { get; set; }
        public void LookAt(Vector3 point) { }
    }

    public sealed class Camera : Behaviour
    {
        public DepthTextureMode depthTextureMode { get; set; }
        public float fieldOfView { get; set; }
        public float aspect { get; set; }
        public float nearClipPlane { get; set; }
        public float farClipPlane { get; set; }
        public int pixelWidth { get; set; }
        public int pixelHeight { get; set; }
        public bool orthographic { get; set; }
        public Matrix4x4 worldToCameraMatrix { get; set; }
        public Matrix4x4 projectionMatrix { get; set; }
        public void ResetWorldToCameraMatrix() { worldToCameraMatrix = new Matrix4x4(); }
        public void ResetProjectionMatrix() { projectionMatrix = new Matrix4x4(); }
    }

    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
        public static Vector3 operator +(Vector3 one, Vector3 other) { return new Vector3(one.x + other.x, one.y + other.y, one.z + other.z); }
    }

    public struct Vector4
    {
        public float x, y, z, w;
        public Vector4(float x, float y, float z, float w) { this.x = x; this.y = y; this.z = z; this.w = w; }
    }

    public struct Quaternion
    {
        public float x, y, z, w;
        public Quaternion(float x, float y, float z, float w) { this.x = x; this.y = y; this.z = z; this.w = w; }
        public static Quaternion Euler(float x, float y, float z) { throw new NotSupportedException(); }
        public static Vector3 operator *(Quaternion turn, Vector3 point) { throw new NotSupportedException(); }
    }

    public struct Matrix4x4
    {
        internal Vector4 Row0, Row1, Row2, Row3;

        public void SetRow(int index, Vector4 row)
        {
            if (index == 0) Row0 = row;
            if (index == 1) Row1 = row;
            if (index == 2) Row2 = row;
            if (index == 3) Row3 = row;
        }
    }

    public class Texture : Object
    {
        public int width { get; protected set; }
        public int height { get; protected set; }
        public FilterMode filterMode { get; set; }
        public TextureWrapMode wrapMode { get; set; }
    }

    public class RenderTexture : Texture { }

    public sealed class Texture2D : Texture
    {
        readonly byte[] given;
        /// <summary>Of the stub: what the GPU would have.</summary>
        internal readonly byte[] Applied;
        internal static int Uploads;

        public Texture2D(int width, int height, TextureFormat textureFormat, bool mipChain, bool linear)
        {
            if (mipChain || !linear) throw new ArgumentException("numbers are not to be averaged or converted");
            this.width = width;
            this.height = height;
            given = new byte[width * height * (textureFormat == TextureFormat.RGBAFloat ? 16 : 4)];
            Applied = new byte[given.Length];
        }

        public void LoadRawTextureData(IntPtr data, int size)
        {
            if (size != given.Length) throw new ArgumentException("not the size of the texture");
            Marshal.Copy(data, given, 0, size);
        }

        public void Apply(bool updateMipmaps, bool makeNoLongerReadable)
        {
            if (IsDestroyed || makeNoLongerReadable) throw new InvalidOperationException();
            Buffer.BlockCopy(given, 0, Applied, 0, given.Length);
            Uploads++;
        }
    }

    public sealed class Shader : Object
    {
        static readonly List<string> Names = new List<string>();
        /// <summary>Of the stub: the shader that there is.</summary>
        internal static string There;

        public bool isSupported { get { return true; } }
        public static Shader Find(string name) { return name == There ? new Shader() : null; }

        public static int PropertyToID(string name)
        {
            if (!Names.Contains(name)) Names.Add(name);
            return Names.IndexOf(name);
        }
    }

    public sealed class Material : Object
    {
        internal readonly Dictionary<int, Vector4> Vectors = new Dictionary<int, Vector4>();
        internal readonly Dictionary<int, Texture> Textures = new Dictionary<int, Texture>();
        public Material(Shader shader) { if (shader == null) throw new ArgumentNullException(); }
        public void SetTexture(int nameID, Texture value) { Textures[nameID] = value; }
        public void SetVector(int nameID, Vector4 value) { Vectors[nameID] = value; }
    }

    public static class Graphics
    {
        public static void Blit(Texture source, RenderTexture dest) { }
        public static void Blit(Texture source, RenderTexture dest, Material mat) { }
    }

    public static class Debug
    {
        internal static readonly List<string> Logged = new List<string>();
        public static void Log(object message, Object context) { Logged.Add("log: " + message); }
        public static void LogWarning(object message, Object context) { Logged.Add("warning: " + message); }
    }

    public static class Time
    {
        public static float time { get { return (float)realtimeSinceStartupAsDouble; } }
        public static double realtimeSinceStartupAsDouble { get { return System.Diagnostics.Stopwatch.GetTimestamp() / (double)System.Diagnostics.Stopwatch.Frequency; } }
        public static int frameCount { get; internal set; }
    }

    public static class Application { public static bool isPlaying { get { return true; } } }
    public static class SystemInfo { public static int maxTextureSize { get { return 16384; } } }
    public static class QualitySettings { public static ColorSpace activeColorSpace { get; internal set; } }

    public enum ColorSpace { Uninitialized = -1, Gamma = 0, Linear = 1 }
    [Flags] public enum DepthTextureMode { None = 0, Depth = 1 }
    public enum TextureFormat { RFloat, RGBAFloat }
    public enum FilterMode { Point, Bilinear }
    public enum TextureWrapMode { Repeat, Clamp }
    [Flags] public enum HideFlags { None = 0, HideAndDontSave = 61 }

    public sealed class TooltipAttribute : Attribute { public TooltipAttribute(string tooltip) { } }
    public sealed class DisallowMultipleComponent : Attribute { }
    public sealed class RequireComponent : Attribute { public RequireComponent(Type requiredComponent) { } }
    public sealed class DefaultExecutionOrder : Attribute { public DefaultExecutionOrder(int order) { } }
    public sealed class AddComponentMenu : Attribute { public AddComponentMenu(string menuName) { } }

    // Not used: names that the client has, too, so that a file that does not say which it means fails here as it would there.
    public struct Pose { }
    public struct Bounds { }
    public struct Ping { }
}

namespace UnityEngine.Rendering
{
    public abstract class RenderPipelineAsset : ScriptableObject { }

    public static class GraphicsSettings { public static RenderPipelineAsset currentRenderPipeline { get { return null; } } }
}
