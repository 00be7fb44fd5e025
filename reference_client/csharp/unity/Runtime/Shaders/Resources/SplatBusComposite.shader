// SPDX-License-Identifier: MIT
// In Resources, so that players have it: SplatBusView finds it by its name.
Shader "Hidden/SplatBus/Composite"
{
    Properties
    {
        [HideInInspector] _MainTex ("Scene", 2D) = "black" {}
    }

    SubShader // URP, where it is installed
    {
        PackageRequirements
        {
            "com.unity.render-pipelines.universal": "12.0"
        }
        Tags { "RenderPipeline" = "UniversalPipeline" }
        Cull Off
        ZWrite Off
        ZTest Always

        Pass
        {
            Name "SplatBus"

            HLSLPROGRAM
            #pragma target 3.5
            #pragma vertex Vertex
            #pragma fragment Fragment
            #include "Packages/com.unity.render-pipelines.universal/ShaderLibrary/Core.hlsl"
            #include "Packages/com.unity.render-pipelines.universal/ShaderLibrary/DeclareDepthTexture.hlsl"
            #include "../Pixel.hlsl"

            TEXTURE2D(_MainTex);
            SAMPLER(sampler_MainTex);

            struct Corner
            {
                float4 position : POSITION;
                float2 uv : TEXCOORD0;
            };

            struct Spot
            {
                float4 position : SV_POSITION;
                float2 uv : TEXCOORD0;
            };

            Spot Vertex(Corner corner)
            {
                Spot spot;
                spot.position = TransformObjectToHClip(corner.position.xyz);
                spot.uv = corner.uv;
                return spot;
            }

            float4 Fragment(Spot spot) : SV_Target
            {
                float4 own = SAMPLE_TEXTURE2D(_MainTex, sampler_MainTex, spot.uv);
                float raw = SampleSceneDepth(spot.uv);
                #if UNITY_REVERSED_Z
                bool isBackground = raw <= 0.0;
                #else
                bool isBackground = raw >= 1.0;
                #endif
                return SplatBusPixel(spot.uv, own, LinearEyeDepth(raw, _ZBufferParams), isBackground);
            }
            ENDHLSL
        }
    }

    SubShader // the built-in pipeline
    {
        Cull Off
        ZWrite Off
        ZTest Always

        Pass
        {
            Name "SplatBus"

            CGPROGRAM
            #pragma target 3.5
            #pragma vertex Vertex
            #pragma fragment Fragment
            #include "UnityCG.cginc"
            #include "../Pixel.hlsl"

            sampler2D _MainTex;
            float4 _MainTex_TexelSize;
            UNITY_DECLARE_DEPTH_TEXTURE(_CameraDepthTexture);

            struct Corner
            {
                float4 position : POSITION;
                float2 uv : TEXCOORD0;
            };

            struct Spot
            {
                float4 position : SV_POSITION;
                float2 uv : TEXCOORD0;
                float2 upright : TEXCOORD1;
            };

            Spot Vertex(Corner corner)
            {
                Spot spot;
                spot.position = UnityObjectToClipPos(corner.position.xyz);
                spot.uv = corner.uv;
                spot.upright = corner.uv;
                #if UNITY_UV_STARTS_AT_TOP
                if (_MainTex_TexelSize.y < 0.0) spot.upright.y = 1.0 - spot.upright.y; // so it says that only the scene is upside down
                #endif
                return spot;
            }

            float4 Fragment(Spot spot) : SV_Target
            {
                float4 own = tex2D(_MainTex, spot.uv);
                float raw = SAMPLE_DEPTH_TEXTURE(_CameraDepthTexture, spot.upright);
                #if UNITY_REVERSED_Z
                bool isBackground = raw <= 0.0;
                #else
                bool isBackground = raw >= 1.0;
                #endif
                return SplatBusPixel(spot.upright, own, LinearEyeDepth(raw), isBackground);
            }
            ENDCG
        }
    }

    Fallback Off
}
